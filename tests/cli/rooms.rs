//! The order of the rooms in `src/`: no file imports in a circle, none imports upward, and a layer has a name once.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use crate::common::needs::root;

/// The layers, each of which may import those in front of it. `bin` is the program on top of them.
const LAYERS: [&[&str]; 18] = [
    &["plural", "printable", "stamp", "topic"],
    &["messages"],
    &["record"],
    &["imu"],
    &["still"],
    &["turns"],
    &["fit"],
    &["engine"],
    &["annotate"],
    &["config"],
    &["error"],
    &["report"],
    &["merge"],
    &["pipeline"],
    &["simulate"],
    &["run"],
    &["lib"],
    &["bin"],
];

/// Those that may know files, clocks, sockets, threads and the command line; every other one is pure.
const SHELL: [&str; 3] = ["run", "lib", "bin"];

type Name = Vec<String>;

/// The files by the names of their modules, without comments and tests.
struct House {
    files: BTreeMap<Name, String>,
    /// What a module exports under another module's name: path of the item by its name here.
    exports: BTreeMap<Name, BTreeMap<String, Name>>,
}

impl House {
    fn read() -> Self {
        let mut files = BTreeMap::new();
        collect(&root().join("src"), &mut Vec::new(), &mut files);
        let mut house = Self { files, exports: BTreeMap::new() };
        for (name, text) in &house.files {
            let mut exports = BTreeMap::new();
            for path in uses(text).filter(|(exported, _)| *exported).map(|(_, path)| path) {
                let (path, alias) = path.rsplit_once(" as ").map_or((path.as_str(), None), |(a, b)| (a, Some(b)));
                let Some(item) = house.absolute(name, path) else { continue };
                let here = alias.map(str::to_owned).or_else(|| item.last().cloned());
                exports.extend(here.map(|here| (here, item)));
            }
            house.exports.insert(name.clone(), exports);
        }
        house
    }

    /// A path as it is seen from the root, if it leads to something of this crate.
    fn absolute(&self, from: &[String], path: &str) -> Option<Name> {
        let mut parts = path.split("::").map(str::trim).peekable();
        let is_bin = from.first().is_some_and(|first| first == "bin");
        let mut base = from.to_vec();
        match *parts.peek()? {
            "crate" => base.truncate(usize::from(is_bin)),
            "stillpoint" if is_bin => base.clear(),
            "self" => {}
            "super" => {
                while parts.next_if_eq(&"super").is_some() {
                    base.pop();
                }
                return Some(base.into_iter().chain(parts.map(str::to_owned)).collect());
            }
            first => {
                let child: Name = from.iter().cloned().chain([first.to_owned()]).collect();
                self.files.contains_key(&child).then_some(())?;
                return Some(base.into_iter().chain(parts.map(str::to_owned)).collect());
            }
        }
        parts.next();
        Some(base.into_iter().chain(parts.filter(|part| *part != "self").map(str::to_owned)).collect())
    }

    /// The file that an item is defined in, whoever exports it.
    fn file_of(&self, item: &[String], depth: usize) -> Name {
        let mut file = Name::new();
        for (i, part) in item.iter().enumerate() {
            let next: Name = file.iter().cloned().chain([part.clone()]).collect();
            if self.files.contains_key(&next) {
                file = next;
                continue;
            }
            let exported = self.exports.get(&file).and_then(|exports| exports.get(part)).filter(|_| depth < 9);
            return match exported {
                Some(exported) => {
                    let rest = item.get(i + 1..).unwrap_or_default();
                    self.file_of(&[exported.as_slice(), rest].concat(), depth + 1)
                }
                None => file,
            };
        }
        file
    }

    /// Items of this crate that a file names, each with the file that defines it.
    fn items<'a>(&'a self, file: &'a Name, text: &'a str) -> impl Iterator<Item = (Name, Name)> + 'a {
        let used =
            uses(text).map(|(_, path)| path.rsplit_once(" as ").map_or(path.clone(), |(path, _)| path.to_owned()));
        let items = used.chain(spelled_out(text)).filter_map(|path| self.absolute(file, &path));
        let items = items.map(|item| (self.file_of(&item, 0), item));
        items.filter(move |(definer, _)| definer != file && self.files.contains_key(definer))
    }

    /// Which files each file imports from.
    fn imports(&self) -> BTreeMap<&Name, BTreeSet<Name>> {
        self.files
            .iter()
            .map(|(file, text)| (file, self.items(file, text).map(|(definer, _)| definer).collect()))
            .collect()
    }
}

fn collect(folder: &Path, name: &mut Name, files: &mut BTreeMap<Name, String>) {
    for entry in std::fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let path = entry.path();
        let stem = path.file_stem().unwrap().to_str().unwrap().to_owned();
        if path.is_dir() {
            // A crate of its own.
            if path.join("Cargo.toml").exists() {
                continue;
            }
            let root = name.is_empty() && ["cli", "commands"].contains(&stem.as_str());
            name.extend(root.then(|| "bin".to_owned()));
            name.push(stem);
            collect(&path, name, files);
            name.pop();
            name.truncate(if root { 0 } else { name.len() });
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let own: &[String] = match (name.is_empty(), stem.as_str()) {
                (_, "lib" | "mod") => &[],
                (true, "main") => &["bin".to_owned()],
                (true, "cli" | "console" | "commands" | "program") => &["bin".to_owned(), stem],
                _ => &[stem],
            };
            let text = std::fs::read_to_string(&path).unwrap();
            let text = text.split("#[cfg(test)]").next().unwrap_or_default();
            let code = text.lines().map(|line| line.split("//").next().unwrap_or_default());
            files.insert([name.as_slice(), own].concat(), code.collect::<Vec<_>>().join("\n"));
        }
    }
}

/// What is imported, one path an item, and whether it is exported again.
fn uses(text: &str) -> impl Iterator<Item = (bool, String)> {
    let statements = text.split_inclusive(';').filter_map(|statement| {
        let at = import_in(statement)?;
        let exported = statement[..at].rsplit('\n').next().unwrap_or_default().trim().starts_with("pub");
        Some((exported, statement[at + 4..].trim_end_matches(';').split_whitespace().collect::<Vec<_>>().join(" ")))
    });
    statements.flat_map(|(exported, tree)| expand("", &tree).into_iter().map(move |path| (exported, path)))
}

/// Where in a statement an import begins.
fn import_in(statement: &str) -> Option<usize> {
    statement.rfind("use ").filter(|&at| {
        let before = statement[..at].rsplit('\n').next().unwrap_or_default().trim();
        before.is_empty() || before.starts_with("pub")
    })
}

/// Every path of several parts that stands outside of imports and visibilities: in an expression, a type, a macro.
fn spelled_out(text: &str) -> impl Iterator<Item = String> {
    let is_part = |c: char| c.is_alphanumeric() || c == '_' || c == ':';
    let code = text.split_inclusive(';').map(|statement| &statement[..import_in(statement).unwrap_or(statement.len())]);
    let code = code.flat_map(|code| {
        code.split("(in ")
            .enumerate()
            .map(|(i, part)| if i == 0 { part } else { part.split_once(')').map_or("", |(_, rest)| rest) })
    });
    let words = code.flat_map(move |code| code.split(move |c| !is_part(c))).map(|word| word.trim_end_matches(':'));
    words.filter(|word| word.contains("::") && !word.starts_with(':')).map(str::to_owned)
}

/// `a::{b, c::{d, e}}` as `a::b`, `a::c::d`, `a::c::e`.
fn expand(front: &str, tree: &str) -> Vec<String> {
    let Some((path, inner)) = tree.split_once('{') else {
        let path = format!("{front}{}", tree.trim());
        return vec![path.strip_suffix("::self").unwrap_or(&path).to_owned()];
    };
    let front = format!("{front}{}", path.trim());
    let inner = inner.trim_end().strip_suffix('}').unwrap_or(inner);
    let (mut depth, mut parts, mut part) = (0, Vec::new(), String::new());
    for c in inner.chars() {
        depth += i32::from(c == '{') - i32::from(c == '}');
        match (c, depth) {
            (',', 0) => parts.push(std::mem::take(&mut part)),
            _ => part.push(c),
        }
    }
    parts.push(part);
    parts.iter().filter(|part| !part.trim().is_empty()).flat_map(|part| expand(&front, part)).collect()
}

fn layer_of(file: &[String]) -> &str {
    file.first().map_or("lib", String::as_str)
}

/// The files that a file imports from, and those that they import from, and so on.
fn reached<'a>(from: &'a Name, imports: &'a BTreeMap<&Name, BTreeSet<Name>>) -> BTreeSet<&'a Name> {
    let (mut reached, mut left) = (BTreeSet::new(), vec![from]);
    while let Some(name) = left.pop() {
        left.extend(imports.get(name).into_iter().flatten().filter(|target| reached.insert(*target)));
    }
    reached
}

#[test]
fn no_file_imports_in_a_circle() {
    let house = House::read();
    let imports = house.imports();
    assert!(imports.len() > 150, "the files are found: {}", imports.len());
    let reached: BTreeMap<_, _> = imports.keys().map(|name| (*name, reached(name, &imports))).collect();
    let circles = imports.iter().map(|(name, targets)| {
        (
            name.join("::"),
            targets.iter().filter(|target| reached[target].contains(name)).map(|target| target.join("::")),
        )
    });
    let circles: Vec<_> =
        circles.flat_map(|(name, back)| back.map(move |target| format!("{name} → {target}"))).collect();
    assert!(circles.is_empty(), "in circles: {circles:#?}");
}

/// A part may carry methods of its root's type, and know the type for that.
#[test]
fn the_root_of_a_module_holds_nothing_that_its_parts_need() {
    let house = House::read();
    let mut found = Vec::new();
    for (file, text) in house.files.iter().filter(|(file, _)| file.last().is_none_or(|name| name != "tests")) {
        for (root, item) in house.items(file, text) {
            let needed = item.last().filter(|name| !text.contains(&format!("impl {name} {{")));
            let is_part = !root.is_empty() && file.starts_with(&root);
            found.extend(needed.filter(|_| is_part).map(|name| format!("{}: {name}", file.join("::"))));
        }
    }
    assert!(found.is_empty(), "{found:#?}");
}

#[test]
fn no_layer_imports_one_above_it() {
    let rank = |layer: &str| {
        let rank = LAYERS.iter().position(|group| group.contains(&layer));
        rank.unwrap_or_else(|| panic!("{layer} has no place in the order of the layers"))
    };
    let house = House::read();
    for (file, targets) in house.imports() {
        for target in targets {
            let (here, there) = (layer_of(file), layer_of(&target));
            assert!(here == there || here == "lib" || rank(there) < rank(here), "{file:?} imports {target:?}");
        }
    }
}

#[test]
fn a_pure_layer_knows_no_file_clock_thread_or_command_line() {
    const IMPURE: [&str; 7] =
        ["std::fs", "std::net", "std::thread", "tokio::", "clap::", "Instant::now", "SystemTime::now"];
    for (file, text) in &House::read().files {
        let found = IMPURE.iter().find(|impure| !SHELL.contains(&layer_of(file)) && text.contains(**impure));
        assert_eq!(found, None, "{file:?}");
    }
}

#[test]
fn a_type_name_stands_once_in_a_layer() {
    let mut places: BTreeMap<(String, String), Vec<&Name>> = BTreeMap::new();
    let house = House::read();
    for (file, text) in house.files.iter().filter(|(file, _)| layer_of(file) != "messages") {
        for line in text.lines() {
            let line =
                line.split_once("pub(").and_then(|(_, rest)| rest.split_once(") ")).map_or(line, |(_, rest)| rest);
            let line = line.strip_prefix("pub ").unwrap_or(line);
            let kinds = ["struct ", "enum ", "trait ", "type "];
            let Some(rest) = kinds.iter().find_map(|kind| line.strip_prefix(kind)) else { continue };
            let name: String = rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
            if !matches!(name.as_str(), "Error" | "Config") {
                places.entry((layer_of(file).to_owned(), name)).or_default().push(file);
            }
        }
    }
    let twice: Vec<_> = places.iter().filter(|(_, files)| files.len() > 1).collect();
    assert!(twice.is_empty(), "{twice:#?}");
}
