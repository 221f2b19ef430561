//! Writes code.

use proc_macro::{Group, Literal, Span, TokenStream, TokenTree};

/// A text as code, with a part in place of each `$`.
pub fn code<const N: usize>(text: &str, parts: [TokenStream; N]) -> TokenStream {
    code_at(Span::call_site(), text, parts)
}

/// As [`code`], at a place in the declaration, where the compiler then reports errors in the text.
pub fn code_at<const N: usize>(place: Span, text: &str, parts: [TokenStream; N]) -> TokenStream {
    let text = text.parse().unwrap_or_else(|error| unreachable!("{error} in the code {text}"));
    filled(text, place, &mut parts.into_iter())
}

fn filled(text: TokenStream, span: Span, parts: &mut dyn Iterator<Item = TokenStream>) -> TokenStream {
    let fill = |mut token: TokenTree| match &token {
        TokenTree::Punct(punct) if punct.as_char() == '$' => parts.next().unwrap_or_default(),
        TokenTree::Group(group) => {
            let content = filled(group.stream(), span, parts);
            let mut group = Group::new(group.delimiter(), content);
            group.set_span(span);
            TokenTree::from(group).into()
        }
        _ => {
            token.set_span(span);
            token.into()
        }
    };
    text.into_iter().map(fill).collect()
}

/// An error of the compilation at a place in the declaration.
pub fn error(place: Span, message: &str) -> TokenStream {
    code_at(place, "::core::compile_error! { $ }", [TokenTree::from(Literal::string(message)).into()])
}
