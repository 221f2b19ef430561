//! The look of pages for people, shared with a project's other documents: style sheet, and frame with a table of
//! contents that folds on phones and marks the current section.

use base64::prelude::{BASE64_STANDARD, Engine as _};
use quick_xml::escape::escape;
use sha2::{Digest as _, Sha256};

/// The pages' style sheet, light and dark. Its colours are properties of `:root`, light ones first.
pub const STYLE: &str = include_str!("page/style.css");

/// Unfolds the contents and marks the current section.
const NAVIGATION: &str = include_str!("page/navigation.js");

/// A self-contained page. Its content security policy lets a browser run these scripts only, and load nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct Document<'a> {
    /// The title, as text.
    pub title: &'a str,
    /// Rules in addition to [`STYLE`].
    pub style: &'a str,
    /// The markup of the `<h1>` and what belongs to it.
    pub header: &'a str,
    /// The contents, as markup of `<li>` with links to the sections; if empty, the page has no navigation.
    pub contents: &'a str,
    /// The markup of the sections.
    pub main: &'a str,
    /// The scripts at the page's end.
    pub scripts: &'a [&'a str],
    /// What the policy allows the scripts, such as `'wasm-unsafe-eval'`.
    pub script_sources: &'a [&'a str],
    /// The sources from which the policy allows pictures, such as `data:`.
    pub picture_sources: &'a [&'a str],
}

impl Document<'_> {
    /// The page in HTML; also valid XML if its parts are.
    #[must_use]
    pub fn html(&self) -> String {
        let navigation =
            format!(include_str!("page/navigation.html"), contents = self.contents, script = NAVIGATION);
        let scripts = self.scripts.iter().map(|script| format!("<script>{script}</script>\n"));
        format!(
            include_str!("page/document.html"),
            policy = self.policy(),
            title = escape(self.title),
            style = STYLE.to_owned() + self.style,
            header = self.header,
            navigation = if self.contents.is_empty() { "" } else { &navigation },
            main = self.main,
            scripts = scripts.collect::<String>(),
        )
    }

    /// The content security policy: only these scripts run, known by their hashes, and nothing is loaded from elsewhere.
    fn policy(&self) -> String {
        let navigation = Some(NAVIGATION).filter(|_| !self.contents.is_empty());
        let scripts = navigation.iter().chain(self.scripts);
        let hashes =
            scripts.map(|script| format!("'sha256-{}'", BASE64_STANDARD.encode(Sha256::digest(script))));
        let script_sources = hashes.chain(self.script_sources.iter().map(ToString::to_string));
        format!(
            "default-src 'none'; script-src {}; style-src 'unsafe-inline'; img-src {}; base-uri 'none'; \
             form-action 'none'",
            script_sources.collect::<Vec<_>>().join(" "),
            self.picture_sources.join(" "),
        )
    }
}

/// A unit's markup, with superscript exponents: `mm2` becomes mm², `s-1` s⁻¹.
#[must_use]
pub fn unit(name: &str) -> String {
    let mut markup = String::new();
    let mut rest = name;
    while let Some(begin) = rest.find(|letter: char| letter.is_ascii_digit()) {
        let (before, from) = rest.split_at(begin);
        let whole = |text: &str| text.find(|letter: char| !letter.is_ascii_digit()).unwrap_or(text.len());
        let mut end = whole(from);
        if let Some(fraction) = from[end..].strip_prefix('.') {
            // Not the dot of a product.
            end += whole(fraction) + usize::from(whole(fraction) > 0);
        }
        let (digits, after) = from.split_at(end);
        let (base, sign) = before.strip_suffix('-').map_or((before, ""), |base| (base, "\u{2212}"));
        // Not the 2 of mmH2O, nor a factor.
        let is_exponent = base.ends_with(|letter: char| letter.is_alphabetic() || "%)".contains(letter))
            && !after.starts_with(char::is_alphanumeric);
        markup += &if is_exponent {
            format!("{}<sup>{sign}{digits}</sup>", escape(base))
        } else {
            format!("{}{digits}", escape(before))
        };
        rest = after;
    }
    markup + &escape(rest)
}

/// A name with breaks between its words: after dots and underscores, and before capitals.
#[must_use]
pub fn breakable(name: &str) -> String {
    let mut text = String::new();
    let mut before = '.';
    for letter in name.chars() {
        let begins_word = matches!(before, '.' | '_') || before.is_lowercase() && letter.is_uppercase();
        if begins_word && !text.is_empty() {
            text += "<wbr/>";
        }
        text.push(letter);
        before = letter;
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The hashes are those of `printf 'alert(1)' | openssl dgst -sha256 -binary | base64`.
    #[test]
    fn the_policy_follows_the_charset_and_knows_each_script() {
        let page = Document {
            scripts: &["alert(1)", "alert(\"2\")\n"],
            script_sources: &["'wasm-unsafe-eval'"],
            picture_sources: &["data:", "blob:"],
            ..Document::default()
        };
        let policy = "<head>\n<meta charset=\"utf-8\"/>\n<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; \
             script-src 'sha256-bhHHL3z2vDgxUt0W3dWQOrprscmda2Y5pLsLg4GF+pI=' \
             'sha256-TjayyNBTgBq8L87v5fEvQyf3DY/BrXf2bm/K1ZgFsJ0=' 'wasm-unsafe-eval'; style-src 'unsafe-inline'; \
             img-src data: blob:; base-uri 'none'; form-action 'none'\"/>\n";
        assert!(page.html().contains(policy), "{}", page.html());
    }

    #[test]
    fn exponents_of_units_are_raised() {
        let cases = [
            ("Pa", "Pa"),
            ("mm2", "mm<sup>2</sup>"),
            ("V/%3", "V/%<sup>3</sup>"),
            ("Pa/(%.%)", "Pa/(%.%)"),
            ("kg.m2/s2", "kg.m<sup>2</sup>/s<sup>2</sup>"),
            ("m3.s-1", "m<sup>3</sup>.s<sup>\u{2212}1</sup>"),
            ("kg.K0.5/(s.Pa)", "kg.K<sup>0.5</sup>/(s.Pa)"),
            ("mmH2O", "mmH2O"),
            ("1/s", "1/s"),
            ("N/m7 & <", "N/m<sup>7</sup> &amp; &lt;"),
            ("", ""),
        ];
        for (name, markup) in cases {
            assert_eq!(unit(name), markup);
        }
    }
}
