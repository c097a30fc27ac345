//! The page, from its parts.

use std::sync::LazyLock;

use data_encoding::BASE64;

/// Where the page has what it shows without a server.
const DATA: &str = "/*DATA*/null";

static PAGE: LazyLock<String> = LazyLock::new(|| {
    include_str!("page/page.html")
        .replace("/*STYLE*/", include_str!("page/page.css"))
        .replace("/*DRAW*/", include_str!("page/draw.js"))
        .replace("/*PAGE*/", include_str!("page/page.js"))
});

/// The page as it is served.
pub fn page() -> &'static str {
    &PAGE
}

/// A page that goes through moments of a stage without a server, with a robot if there is one.
pub fn still_page(stage: &[u8], robot: Option<&[u8]>, moments: &[Vec<u8>]) -> String {
    let moments: Vec<String> = moments.iter().map(|bytes| BASE64.encode(bytes)).collect();
    let robot = robot.map(|bytes| BASE64.encode(bytes));
    let data =
        serde_json::json!({ "stage": BASE64.encode(stage), "robot": robot, "moments": moments });
    page().replacen(DATA, &data.to_string(), 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn page_is_whole_and_asks_for_nothing_elsewhere() {
        assert!(page().contains(DATA));
        let parts = [
            "/*STYLE*/",
            "/*DRAW*/",
            "/*PAGE*/",
            "http://",
            "https://",
            "src=\"",
            "import ",
        ];
        parts
            .iter()
            .for_each(|part| assert!(!page().contains(part), "{part}"));
        let still = still_page(&[1, 2, 3], None, &[vec![4], vec![5]]);
        assert!(
            still.contains(
                r#"const DATA = {"moments":["BA==","BQ=="],"robot":null,"stage":"AQID"};"#
            )
        );
    }
}
