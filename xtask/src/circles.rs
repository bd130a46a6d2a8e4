//! Sibling modules do not use each other in a circle, so that each folder can be read in one order.
//!
//! Of every `src` folder the paths that start at `crate`, `super`, `self` or a name in scope are followed to the module that they mean,
//! also through `use`. Code under `#[cfg(test)]` does not count.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
};

/// Circles that still exist; one that is gone must be removed here.
const KNOWN: &[&str] = &[];

/// What is wrong: circles that are not known, and known ones that are gone.
pub(crate) fn findings(sources: &[(PathBuf, String)]) -> Vec<String> {
    let found = circles(sources);
    let new = found.iter().filter(|(circle, _)| !KNOWN.contains(&circle.as_str()));
    let gone = KNOWN.iter().filter(|known| !found.contains_key(**known));
    let new = new.map(|(circle, why)| format!("{circle} use each other in a circle: {why}"));
    new.chain(gone.map(|known| format!("xtask/src/circles.rs: {known} is no circle any more"))).collect()
}

/// A module by the names from the crate's root.
type Module = Vec<String>;

/// A path in code: the module that contains it, its segments, and the name that a `use` gives it.
struct Mention {
    from: Module,
    path: Vec<String>,
    name: Option<String>,
}

/// The circles of all `src` folders among `files`, each as `folder: module, module`; with the paths that close it.
fn circles(files: &[(PathBuf, String)]) -> BTreeMap<String, String> {
    let is_root = |path: &Path| path.ends_with("src/lib.rs") || path.ends_with("src/main.rs");
    let roots = files.iter().filter(|(path, _)| is_root(path)).filter_map(|(path, _)| path.parent());
    let roots: BTreeSet<&Path> = roots.collect();
    let mut found = BTreeMap::new();
    for root in roots {
        let mut own = Crate::default();
        for (path, text) in files {
            let Ok(inside) = path.strip_prefix(root) else { continue };
            own.add(&module(inside), &tokens(text));
        }
        found.extend(own.circles(&root.to_string_lossy()));
    }
    found
}

/// The module of a file, from its path inside of `src`.
fn module(path: &Path) -> Module {
    let mut names: Module = path.with_extension("").iter().map(|name| name.to_string_lossy().into_owned()).collect();
    if names.last().is_some_and(|name| name == "mod") || names == ["lib"] || names == ["main"] {
        names.pop();
    }
    names
}

/// Words, `::` and single characters of Rust code, without comments, strings and spaces.
fn tokens(text: &str) -> Vec<&str> {
    let mut found = vec![];
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        let is_word = |c: char| c.is_alphanumeric() || c == '_';
        let length = if rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if let Some(string) = rest.strip_prefix("r\"") {
            string.find('"').map_or(rest.len(), |at| at + 3)
        } else if let Some(string) = rest.strip_prefix("r#\"") {
            string.find("\"#").map_or(rest.len(), |at| at + 5)
        } else if c == '"' {
            let mut is_escaped = true;
            let end = rest.find(|c| {
                let ends = c == '"' && !is_escaped;
                is_escaped = c == '\\' && !is_escaped;
                ends
            });
            end.map_or(rest.len(), |at| at + 1)
        } else if rest.starts_with("'\\") {
            rest[3..].find('\'').map_or(rest.len(), |at| at + 4)
        } else if c == '\'' && rest.chars().nth(2) == Some('\'') {
            rest.char_indices().nth(3).map_or(rest.len(), |(at, _)| at)
        } else {
            let length = match c {
                ':' if rest.starts_with("::") => 2,
                c if is_word(c) => rest.find(|c| !is_word(c)).unwrap_or(rest.len()),
                c => c.len_utf8(),
            };
            found.extend((!c.is_whitespace()).then(|| &rest[..length]));
            length
        };
        rest = &rest[length..];
    }
    found
}

/// The modules of a crate and the paths in them.
#[derive(Default)]
struct Crate {
    modules: BTreeSet<Module>,
    mentions: Vec<Mention>,
    /// Modules under `#[cfg(test)]`.
    tests: BTreeSet<Module>,
}

impl Crate {
    fn add(&mut self, module: &Module, tokens: &[&str]) {
        self.modules.insert(module.clone());
        let mut current = module.clone();
        // Depths of the braces of inline modules.
        let (mut depth, mut inline, mut i) = (0, vec![], 0);
        while i < tokens.len() {
            match tokens[i..] {
                ["#", "[", "cfg", ref rest @ ..] => {
                    let end = i + 3 + rest.iter().position(|&token| token == "]").unwrap_or(rest.len());
                    let attribute = &tokens[i..end];
                    i = end + 1;
                    if attribute.contains(&"test") && !attribute.contains(&"not") {
                        i = self.skip_test(&current, tokens, i);
                    }
                    continue;
                }
                ["mod", name, "{", ..] => {
                    current.push(name.to_owned());
                    self.modules.insert(current.clone());
                    inline.push(depth);
                    depth += 1;
                    i += 2;
                }
                ["{", ..] => depth += 1,
                ["}", ..] => {
                    depth -= 1;
                    if inline.last() == Some(&depth) {
                        inline.pop();
                        current.pop();
                    }
                }
                // `use<>` says what an `impl Trait` captures.
                ["use", next, ..] if next != "<" => {
                    let end = tokens[i..].iter().position(|&token| token == ";").map_or(tokens.len(), |n| i + n);
                    self.add_uses(&current, &[], &tokens[i + 1..end]);
                    i = end;
                }
                ["crate" | "super" | "self", "::", ..] => {
                    let n = tokens[i..].chunks(2).take_while(|pair| pair.len() == 2 && pair[1] == "::").count();
                    let path = tokens[i..].iter().step_by(2).take(n + 1).map(|&name| name.to_owned()).collect();
                    self.mentions.push(Mention { from: current.clone(), path, name: None });
                    i += 2 * n;
                }
                _ => {}
            }
            i += 1;
        }
    }

    /// The end of the item under `#[cfg(test)]` that begins at `i`.
    fn skip_test(&mut self, current: &Module, tokens: &[&str], mut i: usize) -> usize {
        let mut depth = 0;
        if let Some(at) = tokens[i..].iter().take(12).position(|&token| token == "mod") {
            let name = tokens.get(i + at + 1).copied().unwrap_or_default();
            self.tests.insert([&current[..], &[name.to_owned()]].concat());
        }
        let is_use = tokens.get(i) == Some(&"use");
        while i < tokens.len() {
            depth += i32::from("{([".contains(tokens[i])) - i32::from("})]".contains(tokens[i]));
            i += 1;
            if depth == 0 && (tokens[i - 1] == ";" || tokens[i - 1] == "}" && !is_use) {
                break;
            }
        }
        i
    }

    /// The paths of a `use`, from the tokens behind `prefix`.
    fn add_uses(&mut self, from: &Module, prefix: &[&str], tree: &[&str]) {
        let Some(open) = tree.iter().position(|&token| token == "{") else {
            let n = tree.iter().position(|&token| token == "as").unwrap_or(tree.len());
            let mut path: Vec<String> =
                prefix.iter().chain(&tree[..n]).filter(|&&token| token != "::").map(|&name| name.to_owned()).collect();
            path.pop_if(|last| last == "self" && n == 1 && !prefix.is_empty());
            let name = tree.get(n + 1).map(|&name| name.to_owned()).or_else(|| path.last().cloned());
            self.mentions.push(Mention { from: from.clone(), path, name });
            return;
        };
        let prefix = [prefix, &tree[..open]].concat();
        let mut depth = 0;
        let inside = &tree[open + 1..tree.len() - 1];
        let branches = inside.split(|&token| {
            depth += i32::from(token == "{") - i32::from(token == "}");
            depth == 0 && token == ","
        });
        branches.filter(|branch| !branch.is_empty()).for_each(|branch| self.add_uses(from, &prefix, branch));
    }

    /// The module that contains what a path means, if it is one of this crate.
    fn resolve(&self, from: &Module, path: &[String], depth: usize) -> Option<Module> {
        let mut current = from.clone();
        let mut path = path;
        let is_child =
            |module: &Module, name: &String| self.modules.contains(&[&module[..], std::slice::from_ref(name)].concat());
        match path.first().map(String::as_str) {
            Some("crate") => current.clear(),
            Some("self" | "super") => {}
            Some(_) if is_child(from, &path[0]) => {
                current.push(path[0].clone());
            }
            _ => return None,
        }
        if path[0] != "super" {
            path = &path[1..];
        }
        while let Some((name, rest)) = path.split_first() {
            if name == "super" {
                current.pop();
            } else if is_child(&current, name) {
                current.push(name.clone());
            } else {
                let renamed = |mention: &&Mention| mention.from == current && mention.name.as_ref() == Some(name);
                let used = self.mentions.iter().find(renamed).filter(|_| depth < 8);
                return used
                    .and_then(|used| self.resolve(&current, &[&used.path[..], rest].concat(), depth + 1))
                    .or(Some(current));
            }
            path = rest;
        }
        Some(current)
    }

    fn circles(&self, root: &str) -> BTreeMap<String, String> {
        // For each folder, what its modules use of each other.
        let mut folders: BTreeMap<Module, Uses> = BTreeMap::new();
        for Mention { from, path, .. } in &self.mentions {
            let is_test = |module: &Module| self.tests.iter().any(|test| module.starts_with(test));
            let Some(to) = self.resolve(from, path, 0).filter(|to| !is_test(from) && !is_test(to)) else { continue };
            let n = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
            if let (Some(a), Some(b)) = (from.get(n), to.get(n)) {
                let why = format!("{} uses {}", from.join("::"), path.join("::"));
                let used = folders.entry(from[..n].to_vec()).or_default().entry(a.clone()).or_default();
                used.entry(b.clone()).or_insert(why);
            }
        }
        let mut found = BTreeMap::new();
        for (folder, uses) in &folders {
            for module in uses.keys() {
                let circle: Vec<&str> = reached(uses, module)
                    .into_iter()
                    .filter(|other| reached(uses, other).contains(&&**module))
                    .collect();
                if circle.is_empty() {
                    continue;
                }
                let between = circle.iter().flat_map(|from| &uses[*from]).filter(|(to, _)| circle.contains(&&***to));
                let why: Vec<&str> = between.map(|(_, why)| why.as_str()).collect();
                let folder = [&[root.to_owned()], &folder[..]].concat().join("/");
                found.insert(format!("{folder}: {}", circle.join(", ")), why.join("; "));
            }
        }
        found
    }
}

/// What each module of a folder uses of the others, and the path that does.
type Uses = BTreeMap<String, BTreeMap<String, String>>;

/// The modules that one uses, also by way of others.
fn reached<'a>(uses: &'a Uses, start: &str) -> BTreeSet<&'a str> {
    let used = |module: &str| uses.get(module).into_iter().flat_map(BTreeMap::keys).map(String::as_str);
    let mut all = BTreeSet::new();
    let mut left: Vec<&str> = used(start).collect();
    while let Some(next) = left.pop() {
        if all.insert(next) {
            left.extend(used(next));
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(files: &[(&str, &str)]) -> Vec<String> {
        let files: Vec<_> =
            files.iter().map(|&(path, text)| (Path::new("a/src").join(path), text.to_owned())).collect();
        circles(&files).into_keys().collect()
    }

    #[test]
    fn circles_are_found_through_every_kind_of_path() {
        let root = ("lib.rs", "mod a; mod b; mod c; pub use b::B;");
        let to_a = ("b.rs", "pub struct B; fn f(_: super::a::A) {}");
        for uses_b in [
            "use crate::{c::C, b::{self, B as Other}};",
            "use super::B;",
            "fn f() -> &'static str { let _ = ('\"', '\\'', \"\\\"\"); crate::b::g::<u8>() }",
            "mod inner { fn f(_: super::super::b::B) {} }",
            "#[cfg(not(test))] use super::b;",
        ] {
            assert_eq!(found(&[root, to_a, ("a.rs", uses_b)]), ["a/src: a, b"], "{uses_b}");
        }
        let through_c = [root, ("a.rs", "use super::c::C;"), ("c/mod.rs", "use super::B;"), to_a];
        assert_eq!(found(&through_c), ["a/src: a, b, c"]);
        let deep =
            [("main.rs", "mod a;"), ("a/mod.rs", ""), ("a/x.rs", "use crate::a::y;"), ("a/y.rs", "use super::x;")];
        assert_eq!(found(&deep), ["a/src/a: x, y"]);
    }

    #[test]
    fn tests_comments_strings_and_other_crates_do_not_count() {
        let root = ("lib.rs", "mod a; mod b; pub use b::B;");
        let to_a = ("b.rs", "pub struct B; fn f(_: super::a::A) {}");
        for harmless in [
            "#[cfg(test)]\nmod tests { use crate::b::B; }",
            "#[cfg(test)] #[allow(x)] use super::{b, B};",
            "#[cfg(test)]\nmod tests;",
            "// super::b::B\n/// [`super::B`]\nconst X: &str = \"super::b\";",
            "use b::B; pub(crate) fn f() {}",
            "pub use other::b;",
        ] {
            let inner = ("a/tests.rs", "use crate::b::B;");
            let files: &[_] = if harmless.ends_with("tests;") { &[inner] } else { &[] };
            assert_eq!(found(&[&[root, to_a, ("a.rs", harmless)], files].concat()), [""; 0], "{harmless}");
        }
    }
}
