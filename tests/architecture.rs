//! Holds the sources to the module table: who may import whom, how long a file may be, and
//! what a module may not be called.

use std::fs;
use std::path::{Path, PathBuf};

/// A module imports only from those named beside it. Top to bottom as in the manual:
/// everything stands above what it uses.
const TABLE: &[(&str, &[&str])] = &[
    ("main", &["cli"]),
    (
        "cli",
        &[
            "study",
            "report",
            "run",
            "ppo",
            "policy",
            "path",
            "env",
            "scene",
            "reference",
            "sim",
            "fabric",
            "tool",
            "mesh",
            "math",
            "file",
        ],
    ),
    (
        "study",
        &[
            "reference",
            "path",
            "env",
            "scene",
            "sim",
            "fabric",
            "tool",
            "mesh",
            "math",
            "file",
        ],
    ),
    ("report", &["mesh", "math", "file"]),
    (
        "run",
        &[
            "ppo", "policy", "path", "env", "scene", "sim", "math", "file",
        ],
    ),
    ("ppo", &["env", "policy", "math"]),
    ("policy", &[]),
    ("path", &["tool", "mesh", "math", "file"]),
    ("env", &["scene", "sim", "fabric", "tool", "mesh", "math"]),
    ("scene", &["sim", "fabric", "tool", "mesh", "math", "file"]),
    ("reference", &["fabric", "tool", "mesh", "math", "file"]),
    ("sim", &["fabric", "tool", "mesh", "math"]),
    ("fabric", &["mesh", "math", "file"]),
    ("tool", &["mesh", "math", "file"]),
    ("mesh", &["math", "file"]),
    ("math", &[]),
    ("file", &[]),
];

const LINE_LIMIT: usize = 600;

/// Names that say nothing about what is inside.
const EMPTY_NAMES: [&str; 8] = [
    "utils", "util", "common", "types", "manager", "helpers", "helper", "misc",
];

/// Macros that write to the terminal, which only `cli` and `main` may.
const PRINTING: [&str; 3] = ["println", "print", "dbg"];

/// What is wrong with a source file of `src`, one message each.
fn violations(file: &Path, source: &str) -> Vec<String> {
    let mut found = Vec::new();
    let names: Vec<_> = file
        .with_extension("")
        .iter()
        .map(|name| name.to_string_lossy().into_owned())
        .collect();
    let module = names[0].as_str();
    let depth = names.iter().filter(|name| *name != "mod").count();
    found.extend(
        names
            .iter()
            .filter(|name| EMPTY_NAMES.contains(&name.as_str()))
            .map(|name| format!("`{name}` says nothing about what is inside")),
    );
    let lines = source.lines().count();
    if lines > LINE_LIMIT {
        found.push(format!("{lines} lines, at most {LINE_LIMIT} allowed"));
    }
    let tokens = tokens(source);
    if !["cli", "main"].contains(&module) {
        found.extend(
            tokens
                .windows(2)
                .filter(|pair| PRINTING.contains(&pair[0].as_str()) && pair[1] == "!")
                .map(|pair| format!("{}! outside cli and main", pair[0])),
        );
    }
    if module == "lib" {
        return found;
    }
    match TABLE.iter().find(|(name, _)| *name == module) {
        None => found.push(format!("module `{module}` is not in the table")),
        Some((_, allowed)) => found.extend(
            imports(&tokens, depth)
                .into_iter()
                .filter(|import| import != module && !allowed.contains(&import.as_str()))
                .map(|import| format!("`{module}` may not import `{import}`")),
        ),
    }
    found
}

/// Top-level modules that the paths of a file name: after `crate::` or the library's own
/// name, also in braces, and after `depth` or more `super::`, which lead from the file's own
/// module to the root.
fn imports(tokens: &[String], depth: usize) -> Vec<String> {
    let mut modules = Vec::new();
    let mut supers = 0;
    for (i, pair) in tokens.windows(2).enumerate() {
        if pair[1] != "::" {
            supers = if pair[0] == "::" { supers } else { 0 };
            continue;
        }
        let names = first_names(&tokens[i + 2..]);
        supers = if pair[0] == "super" { supers + 1 } else { 0 };
        if ["crate", "drape"].contains(&pair[0].as_str()) {
            modules.extend(names);
        } else if supers >= depth {
            // A module within the file is one step further down: then these are its own.
            let is_module = |name: &String| TABLE.iter().any(|(module, _)| module == name);
            modules.extend(names.into_iter().filter(is_module));
        }
    }
    modules.dedup();
    modules
}

/// The names a path goes on with: one, or the first of each branch of a `{...}`.
fn first_names(rest: &[String]) -> Vec<String> {
    if rest.first().is_none_or(|token| token != "{") {
        return rest.first().cloned().into_iter().collect();
    }
    let mut names = Vec::new();
    let mut depth = 0;
    let mut previous = "";
    for token in rest {
        match token.as_str() {
            "{" => depth += 1,
            "}" => depth -= 1,
            name if depth == 1 && matches!(previous, "{" | ",") => names.push(name.into()),
            _ => {}
        }
        if depth == 0 {
            break;
        }
        previous = token;
    }
    names
}

/// Words, `::` and single symbols of Rust source; comments, strings and characters dropped.
fn tokens(source: &str) -> Vec<String> {
    let mut tokens = Vec::new();
    let mut rest = source;
    while let Some(c) = rest.chars().next() {
        let length = skipped(rest);
        if length > 0 {
            rest = &rest[length..];
            continue;
        }
        let is_word = |c: char| c.is_alphanumeric() || c == '_';
        let length = match rest.find(|c| !is_word(c)).unwrap_or(rest.len()) {
            0 if rest.starts_with("::") => 2,
            0 => c.len_utf8(),
            word => word,
        };
        if !c.is_whitespace() {
            tokens.push(rest[..length].into());
        }
        rest = &rest[length..];
    }
    tokens
}

/// Length of the comment, string or character literal that `text` begins with, or 0.
fn skipped(text: &str) -> usize {
    if text.starts_with("//") {
        return text.find('\n').unwrap_or(text.len());
    }
    if text.starts_with("/*") {
        let mut depth = 0;
        for (i, pair) in text.as_bytes().windows(2).enumerate() {
            match pair {
                b"/*" => depth += 1,
                b"*/" => depth -= 1,
                _ => continue,
            }
            if depth == 0 {
                return i + 2;
            }
        }
        return text.len();
    }
    let prefix = ["br", "cr", "r", ""]
        .into_iter()
        .find(|prefix| {
            let quote = text.strip_prefix(prefix);
            let quote = quote.map(|text| text.trim_start_matches('#'));
            !prefix.is_empty() && quote.is_some_and(|text| text.starts_with('"'))
        })
        .unwrap_or("");
    if !prefix.is_empty() {
        let hashes = text[prefix.len()..].bytes().take_while(|c| *c == b'#');
        let hashes = hashes.count();
        let start = prefix.len() + hashes + 1;
        let end = format!("\"{}", "#".repeat(hashes));
        return text[start..]
            .find(&end)
            .map_or(text.len(), |i| start + i + end.len());
    }
    let quote = match text.as_bytes() {
        [b'"', ..] | [b'b' | b'c', b'"', ..] => '"',
        // A lifetime has no closing quote after its first character.
        [b'\'', b'\\', ..] => '\'',
        [b'\'', ..] if text.chars().nth(2) == Some('\'') => '\'',
        _ => return 0,
    };
    let mut escaped = false;
    let start = text.find(quote).expect("matched above") + 1;
    for (i, c) in text[start..].char_indices() {
        if c == quote && !escaped {
            return start + i + 1;
        }
        escaped = c == '\\' && !escaped;
    }
    text.len()
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

#[test]
fn sources_keep_to_the_table() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    assert!(files.contains(&root.join("lib.rs")), "{files:?}");
    files.sort();
    let mut found = Vec::new();
    for path in files {
        let file = path.strip_prefix(&root).unwrap();
        let source = fs::read_to_string(&path).unwrap();
        for violation in violations(file, &source) {
            found.push(format!("src/{}: {violation}", file.display()));
        }
    }
    assert!(found.is_empty(), "\n{}", found.join("\n"));
}

/// Nobody imports from above, and so nothing imports itself in a circle.
#[test]
fn table_goes_downwards() {
    for (i, (module, allowed)) in TABLE.iter().enumerate() {
        for import in *allowed {
            let below = TABLE[i + 1..].iter().any(|(name, _)| name == import);
            assert!(below, "`{import}` is not below `{module}`");
        }
    }
}

fn violations_in(file: &str, source: &str) -> Vec<String> {
    violations(Path::new(file), source)
}

#[test]
fn planted_imports_are_found() {
    let expected = ["`fabric` may not import `sim`"];
    for source in [
        "use crate::sim::Model;",
        "use crate::sim;",
        "pub use crate :: sim::*;",
        "use crate::{math::Vec3, sim::{State, Model}};",
        "use crate::{\n    mesh::{self, TriMesh},\n    sim,\n};",
        "fn f(model: &crate::sim::Model) {}",
        "fn f<'a>(x: &'a str) -> char { let c = '\"'; crate::sim::g('a') }",
        "let text = r#\"\"quoted\"\"#; crate::sim::f()",
        "/* a /* nested */ comment */ use crate::sim;",
        "use super::super::sim::Model;",
        "#[cfg(test)]\nmod tests {\n    use drape::sim::Model;\n}",
    ] {
        assert_eq!(violations_in("fabric/law.rs", source), expected, "{source}");
    }
    let source = "use super::sim::Model;";
    assert_eq!(violations_in("fabric/mod.rs", source), expected);
    assert_eq!(violations_in("fabric.rs", source), expected);
    let source = "use drape::{cli, run::RunFolder};";
    assert_eq!(
        violations_in("main.rs", source),
        ["`main` may not import `run`"]
    );
    assert_eq!(
        violations_in("extra/mod.rs", ""),
        ["module `extra` is not in the table"]
    );
}

#[test]
fn allowed_imports_comments_and_strings_are_not_found() {
    for source in [
        "use crate::math::Vec3;\nuse crate::{fabric::Law, mesh::TriMesh};",
        "//! See [`crate::sim`].\n// use crate::sim;",
        "/* use crate::sim; /* crate::run */ crate::cli */",
        "let text = \"use crate::sim; \\\" println!()\";",
        "let text = br##\"crate::sim \"# crate::run\"##;",
        "use super::law; mod law; eprintln!();",
        "use super::sim; // a module of fabric's own",
        "use other_crate::sim; self::sim::f();",
    ] {
        let none: [&str; 0] = [];
        assert_eq!(violations_in("fabric/law.rs", source), none, "{source}");
    }
}

#[test]
fn planted_faults_of_form_are_found() {
    let long = "\n".repeat(LINE_LIMIT + 1);
    assert_eq!(
        violations_in("sim/step.rs", &long),
        ["601 lines, at most 600 allowed"]
    );
    assert!(violations_in("sim/step.rs", &long[1..]).is_empty());
    for file in ["sim/utils.rs", "sim/utils/mod.rs"] {
        assert_eq!(
            violations_in(file, ""),
            ["`utils` says nothing about what is inside"]
        );
    }
    let source = "fn f() { println!(\"{}\", 1) }";
    assert_eq!(
        violations_in("sim/step.rs", source),
        ["println! outside cli and main"]
    );
    assert!(violations_in("cli/mod.rs", source).is_empty());
    assert!(violations_in("main.rs", source).is_empty());
}
