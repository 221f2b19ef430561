//! Reads a declaration.
//!
//! The compiler has parsed it before, and has removed what `#[cfg]` leaves out: only its parts are to be found. The
//! first export of a new package thus compiles no parser of all of Rust, such as `syn`.

use proc_macro::{Delimiter, Group, Ident, Literal, Span, TokenStream, TokenTree};

use crate::code::{code, error};

/// The declaration of a struct, an enum or a union.
pub struct Declaration {
    pub name: Ident,
    /// The generic parameters with their bounds, without their defaults.
    pub parameters: TokenStream,
    /// The parameters as arguments.
    pub arguments: TokenStream,
    /// The parameters that are types.
    pub types: Vec<TokenTree>,
    /// What follows `where`.
    pub predicates: TokenStream,
    pub is_enum: bool,
    /// Those of an enum. A struct has one, a union none.
    pub variants: Vec<Variant>,
}

pub struct Variant {
    /// `Self` or, in an enum, `Self::Name`.
    pub path: TokenStream,
    pub fields: Vec<Field>,
}

pub struct Field {
    /// Its name or, in a tuple, its number.
    pub member: TokenTree,
    /// The function that persists it, unless it is skipped.
    pub persist: Option<&'static str>,
    /// Where the compiler reports errors.
    pub place: Span,
}

impl Declaration {
    /// Reads the input of a derive macro.
    ///
    /// # Errors
    /// When an attribute `#[persistent(...)]` is wrong.
    pub fn read(input: TokenStream) -> Result<Self, TokenStream> {
        let mut tokens = Tokens::of(input);
        tokens.attributes();
        let keyword = tokens.ident().to_string();
        let name = tokens.ident();
        let (mut parameters, mut arguments, mut types) = (TokenStream::new(), TokenStream::new(), vec![]);
        if tokens.take('<').is_some() {
            while tokens.take('>').is_none() {
                let parameter = tokens.until(&[',', '=', '>']);
                tokens.until(&[',', '>']);
                tokens.take(',');
                parameters.extend(code("$,", [parameter.clone()]));
                let mut parameter = Tokens::of(parameter);
                parameter.attributes();
                let lifetime = parameter.take('\'');
                let is_type = lifetime.is_none() && parameter.take_ident("const").is_none();
                let name = TokenTree::from(parameter.ident());
                types.extend(is_type.then(|| name.clone()));
                arguments.extend(code("$,", [lifetime.into_iter().chain([name]).collect()]));
            }
        }
        let tuple = tokens.group('(');
        tokens.take_ident("where");
        let predicates = tokens.until(&['{', ';']);
        let body = tuple.or_else(|| tokens.group('{'));
        let variants = match keyword.as_str() {
            "struct" => vec![Variant { path: code("Self", []), fields: fields(body)? }],
            "enum" => variants(body)?,
            _ => vec![],
        };
        Ok(Self { name, parameters, arguments, types, predicates, is_enum: keyword == "enum", variants })
    }
}

fn variants(body: Option<Group>) -> Result<Vec<Variant>, TokenStream> {
    let mut tokens = Tokens::of(body.map(|body| body.stream()).unwrap_or_default());
    let mut variants = vec![];
    while !tokens.0.is_empty() {
        tokens.attributes();
        let path = code("Self::$", [TokenTree::from(tokens.ident()).into()]);
        let body = tokens.group('(').or_else(|| tokens.group('{'));
        variants.push(Variant { path, fields: fields(body)? });
        tokens.discriminant();
    }
    Ok(variants)
}

fn fields(body: Option<Group>) -> Result<Vec<Field>, TokenStream> {
    let Some(body) = body else { return Ok(vec![]) };
    let mut tokens = Tokens::of(body.stream());
    let mut fields = vec![];
    while let Some(mut first) = tokens.0.last().cloned() {
        let persist = function(tokens.attributes())?;
        // Of a tuple, `attributes` may have taken a type in parentheses.
        first = tokens.until(&[',']).into_iter().next().unwrap_or(first);
        tokens.take(',');
        let place = first.span().resolved_at(Span::call_site());
        let member = match body.delimiter() {
            Delimiter::Brace => first,
            _ => Literal::usize_unsuffixed(fields.len()).into(),
        };
        fields.push(Field { member, persist, place });
    }
    Ok(fields)
}

/// The function that persists a field, as its attributes `#[persistent(...)]` say.
fn function(attributes: Vec<Group>) -> Result<Option<&'static str>, TokenStream> {
    let mut function = Some("::fmu_export::Persistent::persist");
    for attribute in attributes {
        let mut tokens = Tokens::of(attribute.stream());
        let Some(path) = tokens.take_ident("persistent") else { continue };
        let Some(TokenTree::Group(arguments)) = tokens.0.pop() else {
            return Err(error(
                path.span(),
                "expected attribute arguments in parentheses: #[persistent(...)]",
            ));
        };
        let mut tokens = Tokens::of(arguments.stream());
        while let Some(first) = tokens.0.last().cloned() {
            function = match tokens.until(&[',']).to_string().as_str() {
                "skip" => None,
                "serde" => Some("::fmu_export::persistence::persist_by_serde"),
                found => {
                    return Err(error(first.span(), &format!("expected `skip` or `serde`, found `{found}`")));
                }
            };
            tokens.take(',');
        }
    }
    Ok(function)
}

/// The tokens that are left, in reverse.
struct Tokens(Vec<TokenTree>);

impl Tokens {
    fn of(stream: TokenStream) -> Self {
        let mut tokens = Self(stream.into_iter().collect());
        tokens.0.reverse();
        tokens.open();
        tokens
    }

    /// Opens the groups without delimiters that come first: a `macro_rules` puts its arguments into such.
    fn open(&mut self) {
        while let Some(group) = self.group(' ') {
            self.0.extend(Self::of(group.stream()).0);
        }
    }

    fn take(&mut self, wanted: char) -> Option<TokenTree> {
        self.0.pop_if(|token| sign(token) == wanted)
    }

    fn group(&mut self, delimiter: char) -> Option<Group> {
        match self.take(delimiter) {
            Some(TokenTree::Group(group)) => Some(group),
            _ => None,
        }
    }

    fn take_ident(&mut self, name: &str) -> Option<TokenTree> {
        self.0.pop_if(|token| matches!(token, TokenTree::Ident(ident) if ident.to_string() == name))
    }

    fn ident(&mut self) -> Ident {
        match self.0.pop() {
            Some(TokenTree::Ident(ident)) => ident,
            other => unreachable!("{other:?} where the compiler found a name"),
        }
    }

    /// Takes attributes, which it returns, and visibility: `pub` and a restriction in parentheses.
    fn attributes(&mut self) -> Vec<Group> {
        let mut attributes = vec![];
        self.open();
        while self.take('#').is_some() {
            attributes.extend(self.group('['));
            self.open();
        }
        if self.take_ident("pub").is_some() {
            self.take('(');
            self.open();
        }
        attributes
    }

    /// Takes the tokens before one of these signs that is not between angle brackets.
    fn until(&mut self, ends: &[char]) -> TokenStream {
        let (mut taken, mut depth, mut before) = (vec![], 0_usize, ' ');
        while let Some(token) =
            self.0.pop_if(|token| depth > 0 || before == '-' || !ends.contains(&sign(token)))
        {
            match sign(&token) {
                '<' => depth += 1,
                // Not in `->`.
                '>' if before != '-' => depth -= 1,
                _ => {}
            }
            before = sign(&token);
            taken.push(token);
        }
        taken.into_iter().collect()
    }

    /// Takes a variant's discriminant, and the comma after it. In an expression, `<` is a bracket only after `::`.
    fn discriminant(&mut self) {
        let mut before = ' ';
        while let Some(token) = self.0.pop() {
            match (before, sign(&token)) {
                (_, ',') => break,
                (':', '<') => drop(self.until(&['>'])),
                (_, sign) => before = sign,
            }
        }
    }
}

/// The character of a punctuation, or with which a group begins.
fn sign(token: &TokenTree) -> char {
    match token {
        TokenTree::Punct(punct) => punct.as_char(),
        TokenTree::Group(group) => match group.delimiter() {
            Delimiter::Parenthesis => '(',
            Delimiter::Brace => '{',
            Delimiter::Bracket => '[',
            Delimiter::None => ' ',
        },
        TokenTree::Ident(_) | TokenTree::Literal(_) => 'a',
    }
}
