//! `#[derive(Persistent)]`: a serialized state contains every field of a struct, or the variant of an enum and its
//! fields, in declaration order.

use proc_macro2::TokenStream;
use quote::{ToTokens, format_ident, quote};
use syn::{Data, DataEnum, DeriveInput, Error, Field, Fields, Index, Member, parse_macro_input, parse_quote};

/// Implements `fmu_export::Persistent` for a struct or enum whose fields implement it; an enum's fields also need a
/// `Default`, from which a variant is read.
///
/// A field with `#[persistent(skip)]` is left out: it follows from the others, and `Model::restored` recomputes it. One
/// with `#[persistent(serde)]`, of another crate's type, is saved by its `serde::Serialize` and
/// `serde::Deserialize` (feature `serde` of `fmu-export`).
#[proc_macro_derive(Persistent, attributes(persistent))]
pub fn derive_persistent(input: proc_macro::TokenStream) -> proc_macro::TokenStream {
    let input = parse_macro_input!(input as DeriveInput);
    implementation(input).unwrap_or_else(Error::into_compile_error).into()
}

fn implementation(mut input: DeriveInput) -> Result<TokenStream, Error> {
    let name = &input.ident;
    let body = match &input.data {
        Data::Struct(structure) => {
            let fields = persisted(&structure.fields)?;
            let calls = fields.iter().map(|(member, call)| quote!(#call(&mut self.#member, archive)?;));
            quote!(#(#calls)*)
        }
        Data::Enum(enumeration) if !enumeration.variants.is_empty() => {
            variants(&name.to_string(), enumeration)?
        }
        _ => {
            let reason =
                "only a struct, or an enum with variants, can derive Persistent; implement it by hand";
            return Err(Error::new_spanned(name, reason));
        }
    };
    let is_enum = matches!(input.data, Data::Enum(_));
    for parameter in input.generics.type_params_mut() {
        parameter.bounds.push(parse_quote!(::fmu_export::Persistent));
        if is_enum {
            parameter.bounds.push(parse_quote!(::core::default::Default));
        }
    }
    let (generics, arguments, bounds) = input.generics.split_for_impl();
    let archive = if body.is_empty() { quote!(_) } else { quote!(archive) };
    Ok(quote! {
        #[automatically_derived]
        impl #generics ::fmu_export::Persistent for #name #arguments #bounds {
            fn persist(
                &mut self,
                #archive: &mut ::fmu_export::persistence::Archive<'_>,
            ) -> ::core::result::Result<(), ::fmu_export::Error> {
                #body
                ::core::result::Result::Ok(())
            }
        }
    })
}

/// Persists the number of an enum's variant, then its fields.
fn variants(name: &str, enumeration: &DataEnum) -> Result<TokenStream, Error> {
    let (mut numbers, mut beginnings, mut fields) = (vec![], vec![], vec![]);
    for (number, variant) in (0_u32..).zip(&enumeration.variants) {
        let ident = &variant.ident;
        numbers.push(quote!(Self::#ident { .. } => #number));
        let all = variant.fields.members();
        beginnings.push(quote!(#number => Self::#ident { #(#all: ::core::default::Default::default()),* }));
        let (members, calls): (Vec<_>, Vec<_>) = persisted(&variant.fields)?.into_iter().unzip();
        let bindings = (0..members.len()).map(|position| format_ident!("field_{position}"));
        let bindings: Vec<_> = bindings.collect();
        fields.push(quote! {
            Self::#ident { #(#members: #bindings,)* .. } => {
                #(#calls(#bindings, archive)?;)*
            }
        });
    }
    let refusal = format!("{{variant}} in the serialized state is not a variant of {name}");
    Ok(quote! {
        let before: u32 = match self { #(#numbers),* };
        let mut variant = before;
        ::fmu_export::Persistent::persist(&mut variant, archive)?;
        if variant != before {
            *self = match variant {
                #(#beginnings,)*
                _ => return ::core::result::Result::Err(::fmu_export::Error::new(::std::format!(#refusal))),
            };
        }
        match self { #(#fields)* }
    })
}

/// The fields that are not skipped, each with the function that persists it.
fn persisted(fields: &Fields) -> Result<Vec<(Member, TokenStream)>, Error> {
    let mut persisted = vec![];
    for (index, field) in fields.iter().enumerate() {
        let call = match way(field)? {
            Way::Persistent => quote!(::fmu_export::Persistent::persist),
            Way::Serde => quote!(::fmu_export::persistence::persist_by_serde),
            Way::Skip => continue,
        };
        let member = field.ident.clone().map_or(Member::Unnamed(Index::from(index)), Member::Named);
        persisted.push((member, call));
    }
    Ok(persisted)
}

/// How a field is persisted.
enum Way {
    Persistent,
    Serde,
    Skip,
}

/// As the attribute `#[persistent(...)]` says.
fn way(field: &Field) -> Result<Way, Error> {
    let mut way = Way::Persistent;
    for attribute in field.attrs.iter().filter(|attribute| attribute.path().is_ident("persistent")) {
        attribute.parse_nested_meta(|meta| {
            way = match &meta.path {
                path if path.is_ident("skip") => Way::Skip,
                path if path.is_ident("serde") => Way::Serde,
                path => {
                    let found = path.to_token_stream();
                    return Err(meta.error(format!("expected `skip` or `serde`, found `{found}`")));
                }
            };
            Ok(())
        })?;
    }
    Ok(way)
}
