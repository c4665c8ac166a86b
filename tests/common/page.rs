//! Pages of reports, as text.

/// Fails unless every element is closed in its turn and nothing is loaded from elsewhere.
pub fn check(html: &str) {
    const VOID: [&str; 3] = ["meta", "!doctype", "wbr"];
    let mut open = Vec::new();
    let text = html.replace(html.split("<style>").nth(1).unwrap().split("</style>").next().unwrap(), "");
    for part in text.split('<').skip(1) {
        let (tag, _) = part.split_once('>').unwrap_or_else(|| panic!("a tag without end: {part}"));
        let name = tag.trim_start_matches('/').split([' ', '/']).next().unwrap();
        match (tag.starts_with('/'), tag.ends_with('/') || VOID.contains(&name)) {
            (true, _) => assert_eq!(open.pop(), Some(name.to_owned()), "</{name}> closes another"),
            (_, true) => {}
            _ => open.push(name.to_owned()),
        }
    }
    assert!(open.is_empty(), "left open: {open:?}");
    for elsewhere in ["<script", "http:", "https:", "src=", "url(", "@import", "<link", "NaN", "inf\""] {
        assert!(!html.contains(elsewhere), "{elsewhere}");
    }
}

/// What stands to be copied under a name.
pub fn pasted(html: &str, name: &str) -> String {
    let block = html.split(&format!("<b>{name}</b><pre>")).nth(1).unwrap().split("</pre>").next().unwrap();
    [("&quot;", "\""), ("&#39;", "'"), ("&lt;", "<"), ("&gt;", ">"), ("&amp;", "&")]
        .iter()
        .fold(block.to_owned(), |text, (escaped, plain)| text.replace(escaped, plain))
}
