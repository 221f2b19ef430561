//! `#[derive(Persistent)]`: every field of a struct goes into a serialized state, in the order of declaration.

use proc_macro2::{Span, TokenStream};
use quote::{ToTokens, quote};
use syn::{Data, DeriveInput, Error, Field, Index, Member, parse_macro_input, parse_quote};

/// Implements `fmu_export::Persistent` for a struct whose fields implement it.
///
/// A field with `#[persistent(skip)]` is left out: it follows from the others, and `Model::restored` computes it anew.
#[proc_macro_derive(Persistent, attributes(persistent))]
pub fn derive_persistent(input: proc_macro::TokenStream) -> proc_macro::TokenStream {
    let input = parse_macro_input!(input as DeriveInput);
    implementation(input).unwrap_or_else(Error::into_compile_error).into()
}

fn implementation(mut input: DeriveInput) -> Result<TokenStream, Error> {
    let Data::Struct(structure) = &input.data else {
        return Err(Error::new(
            Span::call_site(),
            "only a struct can derive Persistent; implement it by hand",
        ));
    };
    let mut persisted = vec![];
    for (index, field) in structure.fields.iter().enumerate() {
        if !is_skipped(field)? {
            persisted.push(field.ident.clone().map_or(Member::Unnamed(Index::from(index)), Member::Named));
        }
    }
    for parameter in input.generics.type_params_mut() {
        parameter.bounds.push(parse_quote!(::fmu_export::Persistent));
    }
    let name = &input.ident;
    let (generics, arguments, bounds) = input.generics.split_for_impl();
    let archive = if persisted.is_empty() { quote!(_) } else { quote!(archive) };
    Ok(quote! {
        #[automatically_derived]
        impl #generics ::fmu_export::Persistent for #name #arguments #bounds {
            fn persist(
                &mut self,
                #archive: &mut ::fmu_export::persistence::Archive<'_>,
            ) -> ::core::result::Result<(), ::fmu_export::Error> {
                #(::fmu_export::Persistent::persist(&mut self.#persisted, archive)?;)*
                ::core::result::Result::Ok(())
            }
        }
    })
}

/// Whether a field has the attribute `#[persistent(skip)]`.
fn is_skipped(field: &Field) -> Result<bool, Error> {
    let mut skipped = false;
    for attribute in field.attrs.iter().filter(|attribute| attribute.path().is_ident("persistent")) {
        attribute.parse_nested_meta(|meta| {
            skipped = meta.path.is_ident("skip");
            let unknown = || meta.error(format!("expected `skip`, found `{}`", meta.path.to_token_stream()));
            if skipped { Ok(()) } else { Err(unknown()) }
        })?;
    }
    Ok(skipped)
}
