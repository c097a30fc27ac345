//! No circle of imports among the files of a crate, no file that holds a second idea, no empty
//! names. What a crate may use at all, its manifest says.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use syn::visit::Visit;

const MAX_LINES: usize = 600;

/// Names that say nothing about what is inside.
const EMPTY_NAMES: [&str; 8] = [
    "utils", "util", "common", "types", "manager", "helpers", "helper", "misc",
];

/// A module's name, from the root of its crate: `["sim", "line"]`.
type Module = Vec<String>;

/// What a file says of others.
#[derive(Default)]
struct File {
    /// Paths that it uses, from the root of the crate.
    uses: Vec<Module>,
    /// Names that it passes on, and where they come from.
    reexports: BTreeMap<String, Module>,
    /// Modules below it.
    children: BTreeSet<String>,
    /// Those that only tests have.
    of_tests: BTreeSet<String>,
    module: Module,
}

impl File {
    fn parse(module: Module, source: &str) -> Self {
        let mut file = Self {
            module,
            ..Self::default()
        };
        let source = syn::parse_file(source).expect("sources are Rust");
        for item in &source.items {
            if let syn::Item::Mod(item) = item {
                file.children.insert(item.ident.to_string());
            }
        }
        file.visit_file(&source);
        file
    }

    /// A path as written here, from the root of the crate; none for other crates.
    fn resolve(&self, path: &[String]) -> Option<Module> {
        let mut base = match path.first()?.as_str() {
            "crate" => Vec::new(),
            "self" | "super" => self.module.clone(),
            name if self.children.contains(name) => self.module.clone(),
            _ => return None,
        };
        for segment in path {
            match segment.as_str() {
                "crate" | "self" => {}
                "super" => drop(base.pop()),
                name => base.push(name.into()),
            }
        }
        Some(base)
    }

    fn add(&mut self, tree: &syn::UseTree, mut path: Vec<String>, passed_on: bool) {
        match tree {
            syn::UseTree::Path(inner) => {
                path.push(inner.ident.to_string());
                self.add(&inner.tree, path, passed_on);
            }
            syn::UseTree::Group(group) => {
                for tree in &group.items {
                    self.add(tree, path.clone(), passed_on);
                }
            }
            syn::UseTree::Name(_) | syn::UseTree::Rename(_) | syn::UseTree::Glob(_) => {
                let name = match tree {
                    syn::UseTree::Name(name) => name.ident.to_string(),
                    syn::UseTree::Rename(name) => name.ident.to_string(),
                    _ => "*".into(),
                };
                if name != "self" {
                    path.push(name.clone());
                }
                if passed_on {
                    self.reexports
                        .extend(self.resolve(&path).map(|to| (name, to)));
                } else {
                    self.uses.extend(self.resolve(&path));
                }
            }
        }
    }
}

fn is_of_tests(attributes: &[syn::Attribute]) -> bool {
    let is = |a: &syn::Attribute| {
        a.path().is_ident("cfg") && a.parse_args::<syn::Ident>().is_ok_and(|i| i == "test")
    };
    attributes.iter().any(is)
}

impl Visit<'_> for File {
    fn visit_item_mod(&mut self, item: &syn::ItemMod) {
        if is_of_tests(&item.attrs) {
            self.of_tests.insert(item.ident.to_string());
        } else {
            syn::visit::visit_item_mod(self, item);
        }
    }

    fn visit_item_use(&mut self, item: &syn::ItemUse) {
        let passed_on = !matches!(item.vis, syn::Visibility::Inherited);
        self.add(&item.tree, Vec::new(), passed_on);
    }

    /// `pub(super)` imports nothing.
    fn visit_visibility(&mut self, _: &syn::Visibility) {}

    fn visit_path(&mut self, path: &syn::Path) {
        let names: Vec<String> = path.segments.iter().map(|s| s.ident.to_string()).collect();
        self.uses.extend(self.resolve(&names));
        // What stands in its angle brackets, too.
        syn::visit::visit_path(self, path);
    }
}

/// The files of a crate by their modules, without those of tests.
fn read(root: &Path) -> BTreeMap<Module, File> {
    let mut files = BTreeMap::new();
    let mut folders = vec![root.to_path_buf()];
    while let Some(folder) = folders.pop() {
        let entries = fs::read_dir(&folder).expect("a folder of sources");
        for path in entries.map(|entry| entry.expect("readable").path()) {
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") && !path.ends_with("main.rs") {
                let names = path
                    .strip_prefix(root)
                    .expect("below the root")
                    .with_extension("");
                let mut module: Module = names
                    .iter()
                    .map(|name| name.to_string_lossy().into_owned())
                    .collect();
                if module
                    .last()
                    .is_some_and(|name| name == "mod" || name == "lib")
                {
                    module.pop();
                }
                let source = fs::read_to_string(&path).expect("readable");
                files.insert(module.clone(), File::parse(module, &source));
            }
        }
    }
    let of_tests: BTreeSet<Module> = files
        .values()
        .flat_map(|file| {
            file.of_tests
                .iter()
                .map(|name| [&file.module[..], std::slice::from_ref(name)].concat())
        })
        .collect();
    files.retain(|module, _| !(1..=module.len()).any(|n| of_tests.contains(&module[..n])));
    files
}

/// The file that holds what a path names: re-exports are followed.
fn holder(files: &BTreeMap<Module, File>, path: &[String]) -> Option<Module> {
    let depth = (0..=path.len())
        .rev()
        .find(|&n| files.contains_key(&path[..n]))?;
    let file = &files[&path[..depth]];
    match path.get(depth).and_then(|name| file.reexports.get(name)) {
        Some(to) => holder(files, to),
        None => Some(file.module.clone()),
    }
}

/// A circle of imports, if there is one: the modules along it.
fn circle(files: &BTreeMap<Module, File>) -> Option<Vec<Module>> {
    fn follow(
        at: &Module,
        edges: &BTreeMap<&Module, BTreeSet<Module>>,
        along: &mut Vec<Module>,
        done: &mut BTreeSet<Module>,
    ) -> bool {
        if let Some(start) = along.iter().position(|m| m == at) {
            along.drain(..start);
            return true;
        }
        if done.contains(at) {
            return false;
        }
        along.push(at.clone());
        if edges[at].iter().any(|to| follow(to, edges, along, done)) {
            return true;
        }
        along.pop();
        done.insert(at.clone());
        false
    }
    let used = |file: &File| -> BTreeSet<Module> {
        let all = file.uses.iter().filter_map(|path| holder(files, path));
        all.filter(|to| *to != file.module).collect()
    };
    let edges = files
        .iter()
        .map(|(module, file)| (module, used(file)))
        .collect();
    let (mut along, mut done) = (Vec::new(), BTreeSet::new());
    files
        .keys()
        .any(|module| follow(module, &edges, &mut along, &mut done))
        .then_some(along)
}

fn crates() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let members = fs::read_dir(root.join("crates")).expect("a folder of crates");
    let members = members.map(|entry| entry.expect("readable").path().join("src"));
    members.chain([root.join("src")]).collect()
}

#[test]
fn files_import_each_other_in_no_circle() {
    let mut circles = Vec::new();
    for root in crates() {
        let files = read(&root);
        assert!(!files.is_empty(), "{}", root.display());
        if let Some(circle) = circle(&files) {
            let names: Vec<_> = circle.iter().map(|module| module.join("::")).collect();
            circles.push(format!("{}: {}", root.display(), names.join(" -> ")));
        }
    }
    assert!(circles.is_empty(), "{}", circles.join("\n"));
}

/// What two commands need stands in a file of its own.
#[test]
fn commands_import_no_command() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let files = read(&root);
    let is_command = |module: &Module| {
        let path = root.join(module.join("/")).with_extension("rs");
        module.len() == 2
            && module[0] == "cli"
            && fs::read_to_string(path).is_ok_and(|source| source.contains("pub fn run(args: "))
    };
    let commands: Vec<_> = files.iter().filter(|(name, _)| is_command(name)).collect();
    assert!(commands.len() > 8, "{}", commands.len());
    for (name, file) in commands {
        let others = file.uses.iter().filter_map(|path| holder(&files, path));
        let mut others = others.filter(|other| *other != file.module);
        let other = others.find(|other| is_command(other));
        assert_eq!(other, None, "{}", name.join("::"));
    }
}

/// The check itself finds circles, also through a re-export, and no circle in parent and child
/// that only re-exports.
#[test]
fn circles_are_found() {
    let files = |sources: &[(&str, &str)]| -> BTreeMap<Module, File> {
        let parse = |(name, source): &(&str, &str)| {
            let module: Module = name
                .split("::")
                .filter(|n| !n.is_empty())
                .map(Into::into)
                .collect();
            (module.clone(), File::parse(module, source))
        };
        sources.iter().map(parse).collect()
    };
    let plain = [
        ("", "mod a; pub use a::A;"),
        ("a", "use super::b::B;"),
        ("b", ""),
    ];
    assert_eq!(circle(&files(&plain)), None);
    let direct = [
        ("", ""),
        ("a", "use super::b::B;"),
        ("b", "fn f() { crate::a::g() }"),
    ];
    assert!(circle(&files(&direct)).is_some());
    let through = [
        ("", "mod a; pub use a::A;"),
        ("a", "use super::b::B;"),
        ("b", "use crate::A;"),
    ];
    assert!(circle(&files(&through)).is_some());
    let parent = [("", "mod a; use a::f; struct S;"), ("a", "use super::S;")];
    assert!(circle(&files(&parent)).is_some());
    let in_brackets = [
        ("", ""),
        ("a", "fn f(x: Option<Vec<super::b::B>>) {}"),
        ("b", "fn g(x: impl Fn(&crate::a::A)) {}"),
    ];
    assert!(circle(&files(&in_brackets)).is_some());
}

#[test]
fn files_are_short_and_have_names() {
    for root in crates() {
        let mut folders = vec![root];
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(&folder).expect("a folder of sources") {
                let path = entry.expect("readable").path();
                let name = path.file_stem().unwrap_or_default().to_string_lossy();
                assert!(!EMPTY_NAMES.contains(&&*name), "{}", path.display());
                if path.is_dir() {
                    folders.push(path);
                } else {
                    let lines = fs::read_to_string(&path).expect("text").lines().count();
                    assert!(lines <= MAX_LINES, "{}: {lines} lines", path.display());
                }
            }
        }
    }
}
