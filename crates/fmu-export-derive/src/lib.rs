//! `#[derive(Persistent)]`: a serialized state contains every field of a struct, or the variant of an enum and its
//! fields, in declaration order.

mod code;
mod declaration;

use proc_macro::{Literal, TokenStream, TokenTree};

use code::{code, code_at, error};
use declaration::{Declaration, Variant};

/// Implements `fmu_export::Persistent` for a struct or enum whose fields implement it; an enum's fields also need a
/// `Default`, from which a variant is read.
///
/// A field with `#[persistent(skip)]` is left out: it follows from the others, and `Stepper::restored` recomputes it. One
/// with `#[persistent(serde)]`, of another crate's type, is saved by its `serde::Serialize` and
/// `serde::Deserialize` (feature `serde` of `fmu-export`).
#[proc_macro_derive(Persistent, attributes(persistent))]
pub fn derive_persistent(input: TokenStream) -> TokenStream {
    Declaration::read(input).and_then(implementation).unwrap_or_else(|error| error)
}

fn implementation(declaration: Declaration) -> Result<TokenStream, TokenStream> {
    let Declaration { name, parameters, arguments, types, predicates, is_enum, variants } = declaration;
    if variants.is_empty() {
        let reason = "only a struct, or an enum with variants, can derive Persistent; implement it by hand";
        return Err(error(name.span(), reason));
    }
    let default = if is_enum { "+ ::core::default::Default" } else { "" };
    let bound = format!("$: ::fmu_export::Persistent {default},");
    let bounds = types.into_iter().map(|parameter| code(&bound, [parameter.into()])).collect();
    let number = if is_enum { persist_variant(&name.to_string(), &variants) } else { TokenStream::new() };
    let arms = variants.iter().map(persist_fields).collect();
    Ok(code(
        "#[automatically_derived]
        impl<$> ::fmu_export::Persistent for $<$> where $ $ {
            fn persist(
                &mut self,
                archive: &mut ::fmu_export::persistence::Archive<'_>,
            ) -> ::core::result::Result<(), ::fmu_export::Error> {
                $
                match self { $ }
                ::core::result::Result::Ok(())
            }
        }",
        [parameters, TokenTree::from(name).into(), arguments, bounds, predicates, number, arms],
    ))
}

/// Persists the number of an enum's variant.
fn persist_variant(name: &str, variants: &[Variant]) -> TokenStream {
    let (mut numbers, mut beginnings) = (TokenStream::new(), TokenStream::new());
    for (number, variant) in (0..).zip(variants) {
        let fields = variant.fields.iter();
        let defaults = fields.map(|field| {
            code_at(field.place, "$: ::core::default::Default::default(),", [field.member.clone().into()])
        });
        let number: TokenStream = TokenTree::from(Literal::u32_suffixed(number)).into();
        numbers.extend(code("$ { .. } => $,", [variant.path.clone(), number.clone()]));
        beginnings.extend(code("$ => $ { $ },", [number, variant.path.clone(), defaults.collect()]));
    }
    let refusal = format!("{{variant}} in the serialized state is not a variant of {name}");
    code(
        "let before: u32 = match self { $ };
        let mut variant = before;
        ::fmu_export::Persistent::persist(&mut variant, archive)?;
        if variant != before {
            *self = match variant {
                $
                _ => return ::core::result::Result::Err(::fmu_export::Error::new(::core::format_args!($))),
            };
        }",
        [numbers, beginnings, TokenTree::from(Literal::string(&refusal)).into()],
    )
}

/// Persists the fields of a variant that are not skipped, as an arm of a `match`.
fn persist_fields(variant: &Variant) -> TokenStream {
    let (mut bindings, mut calls) = (TokenStream::new(), TokenStream::new());
    for (number, field) in variant.fields.iter().enumerate() {
        let Some(persist) = field.persist else { continue };
        let member = field.member.clone().into();
        bindings.extend(code_at(field.place, &format!("$: field_{number},"), [member]));
        calls.extend(code_at(field.place, &format!("{persist}(field_{number}, archive)?;"), []));
    }
    code("$ { $ .. } => { $ }", [variant.path.clone(), bindings, calls])
}
