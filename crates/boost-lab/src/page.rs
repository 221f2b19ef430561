//! HTML pages of the reports, which need no other file.

use crate::plot::{self, escaped};

/// The style sheet of all reports, with the figures' colours.
const STYLE: &str = "
* { box-sizing: border-box; }
body { font: 16px/1.55 system-ui, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif; color: var(--ink); background: var(--paper); max-width: 58rem; margin: 2.5em auto; padding: 0 1em; overflow-wrap: break-word; }
h1 { font-size: 1.6em; line-height: 1.25; } h2 { font-size: 1.2em; margin: 2.4em 0 0.6em; border-top: 1px solid var(--rule); padding-top: 1em; }
figure { margin: 1em 0; } figure svg { max-width: 100%; height: auto; } figcaption, .caption { font-size: 0.9em; color: var(--faint); }
.row { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 20rem), 1fr)); gap: 0 1em; }
.panel { min-width: 0; } .plot { width: 100%; } .title { margin: 0.8em 0 0 64px; font-weight: 600; font-size: 0.9em; }
.modebar:focus-within { opacity: 1 !important; }
.legend { display: flex; flex-wrap: wrap; gap: 0 1.2em; margin: 0 0 -0.6em 64px; font-size: 0.85em; } .legend label { display: flex; align-items: center; gap: 0.4em; } .legend span { width: 1.6em; }
table { border-collapse: collapse; width: 100%; font-size: 0.88em; } th { text-align: left; font-weight: 600; white-space: nowrap; }
th, td { padding: 0.35em 0.6em 0.35em 0; vertical-align: top; border-bottom: 1px solid var(--rule); }
td.number { white-space: nowrap; } summary { cursor: pointer; color: var(--faint); font-size: 0.9em; }
";

/// A page with a title, additional style sheet rules and a body of HTML.
pub fn page(title: &str, style: &str, body: &str) -> String {
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" \
         content=\"width=device-width\">\n<title>{}</title>\n<style>{}{STYLE}{style}</style>\n\
         </head>\n<body>\n<noscript><p>The figures are drawn by the script in this page.</p></noscript>\n{body}{}\
         </body>\n</html>\n",
        escaped(title),
        plot::palette(),
        plot::script(),
    )
}
