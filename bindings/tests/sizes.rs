//! Checks that signatures take and return sizes as `Size`: two bare numbers compile in either order.
//!
//! A signature is wrong if it has a width and a height as two integers, whatever they are called (`width` and `height`,
//! `columns` and `rows`, `w` and `h`), or a pair of integers that its name or its pattern makes a size. An array keeps
//! its shape, (H, W), and says so: `shape`. A number of nodes or tiles, a place (y, x) and a range are no sizes.
//!
//! Other languages have no such type (docs/decisions.md). There the width comes first, and Python takes both by name.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::{Path, PathBuf};

/// The words of a pair that is a size.
const SIZES: [&str; 12] = [
    "size",
    "sizes",
    "resolution",
    "screen",
    "modulator",
    "sensor",
    "picture",
    "frame",
    "window",
    "padded",
    "out",
    "inner",
];

/// The names of a width and of a height.
const SIDES: [[&str; 2]; 3] = [["width", "height"], ["columns", "rows"], ["w", "h"]];

/// The types of integers that count pixels.
const INTEGERS: [&str; 5] = ["usize", "u32", "i32", "u64", "i64"];

/// The folders without sources of the project.
const OTHERS: [&str; 6] = ["target", ".git", "node_modules", "build", ".venv", "Generated"];

fn sources(folder: &Path, ending: &str, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() && !OTHERS.contains(&&*name) {
            sources(&path, ending, found);
        } else if path.is_file() && path.extension().is_some_and(|e| e == ending) {
            found.push(path);
        }
    }
}

/// Returns the code of `text` without comments.
fn code(text: &str) -> String {
    let lines = text.lines().map(|line| line.split("//").next().unwrap_or_default());
    let text = lines.collect::<Vec<_>>().join("\n");
    let mut parts = text.split("/*");
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |code, part| {
        code + part.split_once("*/").map_or("", |(_, rest)| rest)
    })
}

/// Returns the index after the bracket that closes the one at `open`.
fn after(text: &[u8], open: usize) -> Option<usize> {
    let mut depth = 0;
    for (at, byte) in text.iter().enumerate().skip(open) {
        match byte {
            b'(' | b'[' | b'{' => depth += 1,
            b')' | b']' | b'}' => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return Some(at + 1);
        }
    }
    None
}

/// Returns the name, the parameters and the returned type of each function of Rust's `code`.
fn functions(code: &str) -> Vec<(String, Vec<String>, String)> {
    let mut all = Vec::new();
    for (at, _) in code.match_indices("fn ") {
        let before = code[..at].chars().next_back();
        let name: String = (code[at + 3..].chars())
            .take_while(|c| c.is_alphanumeric() || *c == '_')
            .collect();
        if name.is_empty() || before.is_some_and(|c| c.is_alphanumeric() || c == '_') {
            continue;
        }
        // Past the generic parameters, which may hold parentheses.
        let mut open = at + 3 + name.len();
        let mut angles = 0;
        let bytes = code.as_bytes();
        while open < bytes.len() && (angles > 0 || bytes[open] != b'(') {
            match bytes[open] {
                b'<' => angles += 1,
                b'>' if bytes[open - 1] != b'-' => angles -= 1,
                _ => {}
            }
            open += 1;
        }
        let Some(end) = after(bytes, open) else { continue };
        let parameters = split(&code[open + 1..end - 1]);
        let rest = &code[end..];
        let body = rest.find(['{', ';']).unwrap_or(rest.len());
        let returned = rest[..body].trim().strip_prefix("->").unwrap_or_default();
        let returned = returned.split(" where ").next().unwrap_or_default().trim();
        all.push((name, parameters, returned.to_owned()));
    }
    all
}

/// Splits a list at the commas that are in no brackets.
fn split(list: &str) -> Vec<String> {
    let (mut parts, mut depth, mut last) = (vec![String::new()], 0, ' ');
    for c in list.chars() {
        match c {
            '(' | '[' | '{' | '<' => depth += 1,
            ')' | ']' | '}' => depth -= 1,
            '>' if last != '-' && last != '=' => depth -= 1,
            _ => {}
        }
        match c {
            ',' if depth == 0 => parts.push(String::new()),
            c => parts.last_mut().unwrap().push(c),
        }
        last = c;
    }
    parts
        .iter()
        .map(|part| part.split_whitespace().collect::<Vec<_>>().join(" "))
        .filter(|part| !part.is_empty())
        .collect()
}

/// Returns whether `name` is `word`, alone or at the end of words that underscores join.
fn ends_with(name: &str, word: &str) -> bool {
    name == word || name.strip_suffix(word).is_some_and(|rest| rest.ends_with('_'))
}

/// Returns whether `text` has a pair of integers.
fn has_pair(text: &str) -> bool {
    (INTEGERS.iter()).any(|kind| text.contains(&format!("({kind}, {kind})")) || text.contains(&format!("[{kind}; 2]")))
}

/// Returns what is wrong with the sizes of a function of Rust.
fn wrong(name: &str, parameters: &[String], returned: &str) -> Option<String> {
    let mut sides = Vec::new();
    for parameter in parameters {
        let Some((pattern, kind)) = parameter
            .split_once(": ")
            .map(|(a, b)| (a.trim_start_matches("mut "), b))
        else {
            continue;
        };
        if INTEGERS.contains(&kind) {
            sides.push(pattern);
        }
        let names: Vec<_> = pattern.split(|c: char| !(c.is_alphanumeric() || c == '_')).collect();
        let is_size = |word: &str| names.iter().any(|name| ends_with(name, word));
        let destructured = SIDES.iter().any(|[a, b]| is_size(a) && is_size(b));
        // A pair of pairs is two ranges.
        let ranges = kind.starts_with("((");
        if has_pair(kind) && !ranges && !kind.contains("Fn") && (destructured || SIZES.iter().any(|word| is_size(word)))
        {
            return Some(format!("`{parameter}` is a size; take a Size"));
        }
    }
    for [width, height] in SIDES {
        let of = |word: &str| {
            sides
                .iter()
                .filter(|side| ends_with(side, word))
                .map(|side| side.strip_suffix(word).unwrap().to_owned())
                .collect::<Vec<_>>()
        };
        let (wide, high) = (of(width), of(height));
        if let Some(prefix) = wide.iter().find(|prefix| high.contains(prefix)) {
            return Some(format!(
                "`{prefix}{width}` and `{prefix}{height}` are a size; take a Size"
            ));
        }
    }
    let named = SIZES.iter().any(|word| ends_with(name, word));
    (named && has_pair(returned)).then(|| format!("`{name}` returns `{returned}`; return a Size"))
}

/// Returns the faults of Rust's `text`.
fn faults(text: &str) -> Vec<String> {
    (functions(&code(text)).iter())
        .filter_map(|(name, parameters, returned)| {
            wrong(name, parameters, returned).map(|fault| format!("{name}: {fault}"))
        })
        .collect()
}

#[test]
fn signatures_have_no_bare_sizes() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let mut files = Vec::new();
    // The bindings hand on the widths and heights of other languages.
    for folder in ["sdk", "models", "tools", "examples", "fuzz", "tests"] {
        sources(&root.join(folder), "rs", &mut files);
    }
    let mut all = Vec::new();
    for path in files {
        // The one place of the conversion between sizes and shapes.
        if path.ends_with("kernels/src/size.rs") {
            continue;
        }
        let name = path.strip_prefix(root).unwrap().display().to_string();
        all.extend(
            faults(&fs::read_to_string(&path).unwrap())
                .into_iter()
                .map(|fault| format!("{name}: {fault}")),
        );
    }
    assert!(all.is_empty(), "{}", all.join("\n"));
}

#[test]
fn bare_sizes_are_found() {
    for text in [
        "fn f(height: usize, width: usize) {}",
        "fn f(width: u32, name: &str, height: u32);",
        "fn f(width: u64, height: u64, most: u64) {}",
        "fn f(out_height: usize, out_width: usize) {}",
        "fn f(&self, rows: usize, columns: usize) -> Result<()> {}",
        "fn f((height, width): (usize, usize)) {}",
        "fn f<T: Fn(usize) -> (usize, usize)>(of: T, (h, w): (usize, usize)) {}",
        "fn f(size: (usize, usize)) {}",
        "fn f(screen: Option<(u32, u32)>) {}",
        "fn size(&self) -> (usize, usize) {}",
        "fn padded_size(&self) -> Result<(usize, usize)> {}",
        "fn f(modulator: [usize; 2]) {}",
    ] {
        assert_eq!(faults(text).len(), 1, "{text}: {:?}", faults(text));
    }
    for text in [
        "fn f(size: Size) -> Size {}",
        "fn f(Size { width, height }: Size) {}",
        "fn f(width: usize, row_stride: usize) {}",
        "fn f(height: usize, out_width: usize) {}",
        "fn f(shape: (usize, usize)) {}",
        "fn shape(self) -> (usize, usize) {}",
        "fn f((y, x): (usize, usize), nodes: (usize, usize)) -> (usize, usize) {}",
        "fn f((columns, rows): ((u32, u32), (u32, u32))) {}",
        "// fn f(height: usize, width: usize)",
        "fn frame(&self, progress: &dyn Fn(usize, usize)) {}",
    ] {
        assert_eq!(faults(text), Vec::<String>::new(), "{text}");
    }
}

/// Returns the lists in parentheses of `code` that have a width and a height as separate parameters, in another order
/// than `(…, width, height, …)`.
fn out_of_order(code: &str) -> Vec<String> {
    let mut all = Vec::new();
    for (open, _) in code.match_indices('(') {
        let Some(end) = after(code.as_bytes(), open) else {
            continue;
        };
        let list = &code[open + 1..end - 1];
        let names: Vec<_> = (split(list).iter())
            .map(|parameter| {
                let name = parameter.split([':', '=']).next().unwrap_or_default().trim();
                name.split([' ', '*', '&']).next_back().unwrap_or_default().to_owned()
            })
            .collect();
        let place = |word: &str| names.iter().position(|name| name == word);
        if let (Some(width), Some(height)) = (place("width"), place("height"))
            && height != width + 1
        {
            all.push(list.split_whitespace().collect::<Vec<_>>().join(" "));
        }
    }
    all
}

#[test]
fn other_languages_take_the_width_first() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let mut files = Vec::new();
    for (folder, ending) in [
        ("bindings/src", "rs"),
        ("bindings/c/src", "rs"),
        ("bindings/web/src", "rs"),
        ("bindings/web/package/src", "ts"),
        ("bindings/c/include", "h"),
        ("bindings/c/include", "hpp"),
        ("bindings/unity/Runtime", "cs"),
        ("android/phasefront/src/core", "kt"),
        ("android/phasefront/src/main", "kt"),
        ("ios/Sources/PhasefrontCore", "swift"),
    ] {
        let before = files.len();
        sources(&root.join(folder), ending, &mut files);
        assert!(files.len() > before, "{folder} has no .{ending}");
    }
    let mut all = Vec::new();
    for path in files {
        let name = path.strip_prefix(root).unwrap().display().to_string();
        let text = fs::read_to_string(&path).unwrap();
        all.extend(
            out_of_order(&code(&text))
                .iter()
                .map(|list| format!("{name}: ({list})")),
        );
    }
    assert!(all.is_empty(), "{}", all.join("\n"));
}

#[test]
fn widths_behind_heights_are_found() {
    for text in [
        "void f(uint32_t height, uint32_t width);",
        "void F(int width, double z, int height) {}",
        "fun f(height: Int, width: Int = 1) {}",
        "f(uint32_t *height, uint32_t *width)",
    ] {
        assert_eq!(out_of_order(text).len(), 1, "{text}");
    }
    for text in [
        "void f(double z, uint32_t width, uint32_t height, void *to);",
        "fun f(zMm: Double, width: Int, height: Int = 2) {}",
        "preview(zMm: number, { width, height }: Size): void",
        "f(uint32_t *width, uint32_t *height)",
    ] {
        assert_eq!(out_of_order(text), Vec::<String>::new(), "{text}");
    }
}
