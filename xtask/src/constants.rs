//! Every number that decides a result: read from the sources, checked, and written as a page.

use proc_macro2::{Span, TokenStream, TokenTree};
use quote::ToTokens;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use syn::spanned::Spanned;
use syn::visit::{self, Visit};
use syn::{Attribute, Expr, Lit, Type};

/// The crates between a recording and a map.
pub const CRATES: [&str; 9] =
    ["core", "table", "recording", "observe", "numerics", "inference", "identify", "diagnose", "maps"];

/// Exact factors between units, each a definition.
const DEFINITIONS: &str = "crates/core/src/unit_factors.rs";

/// Exact factors of formulas: the file, its literals, and the formula.
const FORMULAS: &[(&str, &[f64], &str)] = &[
    ("crates/recording/src/logs/proposal/physics.rs", &[4.0], "area of a circle"),
    ("crates/recording/src/logs/proposal/shared_units.rs", &[4.0], "area of a circle"),
    ("crates/numerics/src/coloured_noise.rs", &[6.0, 24.0, 120.0, 720.0, 5040.0], "series of e^-x"),
    ("crates/numerics/src/root.rs", &[3.0, 4.0], "Brent's rule of the shortest step, and his tolerance"),
    (
        "crates/observe/src/model_inputs/smoother.rs",
        &[0.25, 3.0],
        "cubic with given slopes; integrated noise; window of a spline",
    ),
    ("crates/maps/src/map_fit/solution.rs", &[3.0], "variance of a uniform share"),
    ("crates/maps/src/map_fit/speed_lines.rs", &[3.0, 6.0], "natural cubic spline"),
];

/// Maximum number of judgements: as many as a reader can examine.
const MAX_JUDGEMENTS: usize = 30;

/// Literals that are allowed anywhere.
const NEUTRAL: [f64; 4] = [0.0, 0.5, 1.0, 2.0];

/// Macros that format text, in which a number changes no result; nor does one in `fmt`.
const FORMATTING: [&str; 6] = ["format", "write", "writeln", "println", "assert", "debug_assert"];

/// Functions that show the progress of a computation, in which a share changes no result.
const SHOWING: &str = "progress";

/// Endings of names, and their units. A longer ending comes first.
const UNITS: [(&str, &str); 33] = [
    ("_KG_KG", "kg/kg"),
    ("_K_MIN", "K/min"),
    ("_K_M", "K/m"),
    ("_PER_S2", "1/s2"),
    ("_PER_S", "1/s"),
    ("_KG_M3", "kg/m3"),
    ("_J_KGK", "J/(kg K)"),
    ("_W_M2K", "W/(m2 K)"),
    ("_RPM_S", "rpm/s"),
    ("_PA_S", "Pa/s"),
    ("_KG_S", "kg/s"),
    ("_M_S", "m/s"),
    ("_K_S", "K/s"),
    ("_BYTES", "bytes"),
    ("_RATIO", "1"),
    ("_SHARE", "1"),
    ("_SIGMAS", "sigma"),
    ("_SAMPLES", "samples"),
    ("_INTERVALS", "intervals"),
    ("_ROWS", "rows"),
    ("_BLOCKS", "blocks"),
    ("_MM2", "mm2"),
    ("_RPM", "rpm"),
    ("_MM", "mm"),
    ("_PA", "Pa"),
    ("_HZ", "Hz"),
    ("_NS", "ns"),
    ("_M2", "m2"),
    ("_ETA", "1"),
    ("_K", "K"),
    ("_W", "W"),
    ("_M", "m"),
    ("_S", "s"),
];

/// Where a number comes from. The comment of a constant names it: `Source: `, `Bound: `, `Calibrated: ` or `Judgement: `.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A standard, a paper, a handbook, a declared uncertainty or a definition.
    Source,
    /// A limit of physics, of resolution or of effort, beyond which the value makes no difference.
    Bound,
    /// Fitted to data by a command, which the comment names.
    Calibrated,
    /// Chosen without any of these.
    Judgement,
    /// Computed from other constants.
    Derived,
}

impl Kind {
    const ALL: [(Self, &str); 5] = [
        (Self::Source, "source"),
        (Self::Bound, "bound"),
        (Self::Calibrated, "calibrated"),
        (Self::Judgement, "judgement"),
        (Self::Derived, "derived"),
    ];

    fn name(self) -> &'static str {
        Self::ALL.iter().find(|(kind, _)| *kind == self).map_or("", |(_, name)| name)
    }

    /// The kind that a comment names; `None` if it names none.
    fn of(comment: &str) -> Option<Self> {
        let words = [
            ("Source:", Self::Source),
            ("Bound:", Self::Bound),
            ("Calibrated:", Self::Calibrated),
            ("Judgement:", Self::Judgement),
        ];
        words.iter().find(|(word, _)| comment.contains(word)).map(|(_, kind)| *kind)
    }
}

/// A constant number, or a field of a constant.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Constant {
    /// Its name, with that of the field.
    pub name: String,
    /// Its expression.
    pub value: String,
    /// Its comment.
    pub comment: String,
    /// `None` if the comment names none.
    pub kind: Option<Kind>,
    /// Line in its file, from 1.
    pub line: usize,
}

impl Constant {
    /// Whether its value is more than neutral numbers and small integers.
    fn is_chosen(&self) -> bool {
        let mut content = Content::default();
        content.read(self.value.parse().unwrap_or_default());
        content.chosen
    }
}

/// A literal outside constants.
#[derive(Debug, Clone, PartialEq)]
pub struct Literal {
    /// Its value.
    pub value: f64,
    /// Line in its file, from 1.
    pub line: usize,
}

/// The numbers of a file, tests left out.
#[derive(Debug, Default)]
pub struct Numbers {
    /// Constants and fields of constants, in order.
    pub constants: Vec<Constant>,
    /// Float literals outside constants that are not neutral.
    pub literals: Vec<Literal>,
    /// The source text, for comments of fields, which the parser omits.
    lines: Vec<String>,
}

/// The numbers of a source text.
///
/// # Errors
/// That of the parser if it is not Rust.
pub fn numbers(text: &str) -> Result<Numbers, syn::Error> {
    let mut numbers = Numbers { lines: text.lines().map(str::to_owned).collect(), ..Numbers::default() };
    numbers.visit_file(&syn::parse_file(text)?);
    Ok(numbers)
}

/// The page of all constants.
///
/// # Errors
/// Every violation, a line each, or the file that cannot be read.
pub fn page(root: &Path) -> Result<String, String> {
    let violations = violations(root)?;
    if !violations.is_empty() {
        return Err(violations.join("\n"));
    }
    let (mut sections, mut counts) = (String::new(), String::new());
    let mut totals = [0; Kind::ALL.len()];
    for name in CRATES {
        let (mut rows, mut count) = (String::new(), [0; Kind::ALL.len()]);
        for (file, found) in crate_numbers(root, name)? {
            for constant in found.constants {
                for (i, (kind, _)) in Kind::ALL.iter().enumerate() {
                    count[i] += usize::from(constant.kind == Some(*kind));
                }
                rows += &row(&constant, &file);
            }
        }
        let sum: usize = count.iter().sum();
        let cells: Vec<String> = count.iter().map(usize::to_string).collect();
        let _ = writeln!(counts, "| {name} | {sum} | {} |", cells.join(" | "));
        totals = std::array::from_fn(|i| totals[i] + count[i]);
        let _ = write!(
            sections,
            "\n## {name}: {sum}\n\n| name | value | unit | kind | what it is and where it comes from | file |\n|---|---|---|---|---|---|\n{rows}"
        );
    }
    let cells: Vec<String> = totals.iter().map(usize::to_string).collect();
    let _ = writeln!(counts, "| all | {} | {} |", totals.iter().sum::<usize>(), cells.join(" | "));
    Ok(format!("{HEAD}{counts}{sections}{}", calibration(root)?))
}

const HEAD: &str = "\
# Numeric constants

Generated by `cargo xtask docs` from the sources; do not edit. Every number of the crates between a recording and a map. Each has one of five
kinds. *source*: a standard, paper, handbook or definition. *bound*: a limit of physics, resolution or effort. *calibrated*: fitted to data
by the named command. *judgement*: none of these; `python3 benches/constants.py --copy FOLDER RECORDING...` gives the effect of each on the
results when it is halved and doubled. *derived*: computed from other constants. Equations and properties of the machine are in
[the model](model.md), limits of readings in [files](files.md).

| crate | numbers | source | bound | calibrated | judgement | derived |
|---|---|---|---|---|---|---|
";

/// The calibration of the gap diagnosis, which is a data file.
const CALIBRATION: &str = "crates/diagnose/calibration.json";

/// The section of [`CALIBRATION`]: each number with its origin.
fn calibration(root: &Path) -> Result<String, String> {
    let at = |error: &dyn std::fmt::Display| format!("{CALIBRATION}: {error}");
    let text = std::fs::read_to_string(root.join(CALIBRATION)).map_err(|error| at(&error))?;
    let file: serde_json::Value = serde_json::from_str(&text).map_err(|error| at(&error))?;
    let mut numbers = Vec::new();
    for (key, value) in file.as_object().into_iter().flatten() {
        match value {
            serde_json::Value::Number(number) => numbers.push((key.clone(), decimals(number))),
            serde_json::Value::Array(all) => {
                numbers.extend(all.iter().enumerate().map(|(i, number)| {
                    (format!("{key}_{i}"), number.as_number().map(decimals).unwrap_or_default())
                }));
            }
            _ => {}
        }
    }
    numbers.sort();
    let mut section = format!(
        "\n## Calibration of the gap diagnosis: {}\n\nIn `{CALIBRATION}`, by `{}`. Origins: *data* determine it; it ends at a *bound* set by \
         hand; the data hardly narrow its *prior*; it is *copied* from the calibration before.\n\n| number | value | origin |\n|---|---|---|\n",
        numbers.len(),
        file["made_by"].as_str().unwrap_or_default(),
    );
    for (key, value) in numbers {
        let origin = file["origins"][&key].as_str().ok_or_else(|| at(&format!("{key} has no origin")))?;
        let _ = writeln!(section, "| `{key}` | {value} | {origin} |");
    }
    Ok(section)
}

/// Four decimals, as many as any of these numbers needs.
fn decimals(number: &serde_json::Number) -> String {
    format!("{:.4}", number.as_f64().unwrap_or(f64::NAN))
}

fn row(constant: &Constant, file: &str) -> String {
    let cell = |text: &str| text.replace('|', "\\|");
    let Constant { name, value, comment, kind, .. } = constant;
    let kind = kind.map_or("-", Kind::name);
    let within = file.split_once("/src/").map_or(file, |(_, within)| within);
    format!("| `{name}` | {} | {} | {kind} | {} | {within} |\n", cell(value), unit(name), cell(comment))
}

fn unit(name: &str) -> &'static str {
    let upper = name.rsplit('.').next().unwrap_or(name).to_uppercase();
    UNITS.iter().find(|(ending, _)| upper.ends_with(ending)).map_or("", |(_, unit)| unit)
}

/// Literals outside constants, and constants without a kind: one line each.
///
/// # Errors
/// The file that cannot be read.
pub fn violations(root: &Path) -> Result<Vec<String>, String> {
    let mut violations = Vec::new();
    let mut judgements = 0;
    for name in CRATES {
        for (file, found) in crate_numbers(root, name)? {
            judgements +=
                found.constants.iter().filter(|constant| constant.kind == Some(Kind::Judgement)).count();
            violations.extend(violations_of(&file, &found));
        }
    }
    if judgements > MAX_JUDGEMENTS {
        violations.push(format!("{judgements} judgements, at most {MAX_JUDGEMENTS}"));
    }
    Ok(violations)
}

fn violations_of(file: &str, found: &Numbers) -> Vec<String> {
    let is_factor =
        |value: f64| FORMULAS.iter().any(|(of, factors, _)| *of == file && factors.contains(&value));
    let literals = found
        .literals
        .iter()
        .filter(|literal| !is_factor(literal.value))
        .map(|literal| format!("{file}:{}: {} outside a constant", literal.line, literal.value));
    let constants = found.constants.iter().filter(|constant| constant.kind.is_none()).map(|constant| {
        format!(
            "{file}:{}: the comment of {} has no `Source: `, `Bound: `, `Calibrated: ` or `Judgement: `",
            constant.line, constant.name
        )
    });
    literals.chain(constants).collect()
}

/// The numbers of each file of a crate, by its path.
fn crate_numbers(root: &Path, name: &str) -> Result<Vec<(String, Numbers)>, String> {
    let crates = root.join("crates");
    let mut files = Vec::new();
    rust_files(&crates.join(name).join("src"), &mut files)
        .map_err(|error| format!("crates/{name}: {error}"))?;
    files.retain(|file| !file.ends_with(DEFINITIONS));
    files.sort();
    files
        .into_iter()
        .map(|path| {
            let at = |error: &dyn std::fmt::Display| format!("{}: {error}", path.display());
            let text = std::fs::read_to_string(&path).map_err(|error| at(&error))?;
            let within = path.strip_prefix(root).unwrap_or(&path).to_string_lossy().replace('\\', "/");
            Ok((within, numbers(&text).map_err(|error| at(&error))?))
        })
        .collect()
}

fn rust_files(folder: &Path, found: &mut Vec<PathBuf>) -> std::io::Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            rust_files(&path, found)?;
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
    Ok(())
}

impl Numbers {
    fn constant(&mut self, name: String, attributes: &[Attribute], typed: Option<&Type>, value: &Expr) {
        let mut content = Content::default();
        content.read(value.to_token_stream());
        let counts = typed.is_none_or(is_number);
        // A table of texts is none, unless it has a number like 0.3.
        let floats = content.floats && (!content.texts || content.chosen || matches!(value, Expr::Struct(_)));
        let whole = content.integers && !content.texts && counts;
        if !(floats || whole) {
            return;
        }
        let comment = comment(attributes);
        if let Expr::Struct(constant) = value {
            for field in &constant.fields {
                let own = self.comment_before(field.span().start().line);
                let member = field.member.to_token_stream();
                let before = self.constants.len();
                self.constant(format!("{name}.{member}"), &[], None, &field.expr);
                for constant in &mut self.constants[before..] {
                    constant.comment.clone_from(if own.is_empty() { &comment } else { &own });
                    constant.kind = constant.kind.or_else(|| Kind::of(&own)).or_else(|| Kind::of(&comment));
                }
            }
            return;
        }
        let derived = content.paths && !content.chosen;
        self.constants.push(Constant {
            value: value
                .span()
                .source_text()
                .unwrap_or_default()
                .split_whitespace()
                .collect::<Vec<_>>()
                .join(" "),
            kind: Kind::of(&comment).or(derived.then_some(Kind::Derived)),
            line: value.span().start().line,
            name,
            comment,
        });
    }

    /// The comment in the lines before this one, which counts from 1.
    fn comment_before(&self, line: usize) -> String {
        let before = self.lines[..line.saturating_sub(1)].iter().rev();
        let mut comment: Vec<&str> = before.map_while(|line| line.trim().strip_prefix("// ")).collect();
        comment.reverse();
        comment.join(" ")
    }

    fn literal(&mut self, literal: &Lit, at: Span) {
        if let Lit::Float(float) = literal
            && let Ok(value) = float.base10_parse::<f64>()
            && !NEUTRAL.contains(&value)
        {
            self.literals.push(Literal { value, line: at.start().line });
        }
    }

    fn tokens(&mut self, tokens: TokenStream) {
        for token in tokens {
            match token {
                TokenTree::Group(group) => self.tokens(group.stream()),
                TokenTree::Literal(literal) => self.literal(&Lit::new(literal.clone()), literal.span()),
                TokenTree::Ident(_) | TokenTree::Punct(_) => {}
            }
        }
    }
}

impl<'ast> Visit<'ast> for Numbers {
    fn visit_item_const(&mut self, item: &'ast syn::ItemConst) {
        if !is_for_tests(&item.attrs) {
            self.constant(item.ident.to_string(), &item.attrs, Some(&item.ty), &item.expr);
        }
    }

    fn visit_item_static(&mut self, item: &'ast syn::ItemStatic) {
        if !is_for_tests(&item.attrs) {
            self.constant(item.ident.to_string(), &item.attrs, Some(&item.ty), &item.expr);
        }
    }

    fn visit_impl_item_const(&mut self, item: &'ast syn::ImplItemConst) {
        self.constant(item.ident.to_string(), &item.attrs, Some(&item.ty), &item.expr);
    }

    fn visit_item_mod(&mut self, item: &'ast syn::ItemMod) {
        if !is_for_tests(&item.attrs) {
            visit::visit_item_mod(self, item);
        }
    }

    fn visit_item_fn(&mut self, item: &'ast syn::ItemFn) {
        if !is_for_tests(&item.attrs) {
            visit::visit_item_fn(self, item);
        }
    }

    /// The fields that a `Default` chooses are fields of a constant.
    fn visit_item_impl(&mut self, item: &'ast syn::ItemImpl) {
        match default_of(item) {
            _ if is_for_tests(&item.attrs) => {}
            Some((name, function, value)) => {
                let before = self.constants.len();
                self.constant(name, &function.attrs, None, value);
                let of_default = self.constants.split_off(before);
                self.constants.extend(of_default.into_iter().filter(Constant::is_chosen));
            }
            None => visit::visit_item_impl(self, item),
        }
    }

    fn visit_expr_call(&mut self, call: &'ast syn::ExprCall) {
        if !matches!(&*call.func, Expr::Path(path) if path.path.is_ident(SHOWING)) {
            visit::visit_expr_call(self, call);
        }
    }

    fn visit_impl_item_fn(&mut self, item: &'ast syn::ImplItemFn) {
        if !is_for_tests(&item.attrs) && item.sig.ident != "fmt" {
            visit::visit_impl_item_fn(self, item);
        }
    }

    fn visit_lit(&mut self, literal: &'ast Lit) {
        self.literal(literal, literal.span());
    }

    fn visit_macro(&mut self, used: &'ast syn::Macro) {
        if !FORMATTING.iter().any(|name| used.path.is_ident(name)) {
            self.tokens(used.tokens.clone());
        }
    }
}

/// What the value of a constant consists of.
#[derive(Default)]
struct Content {
    floats: bool,
    integers: bool,
    texts: bool,
    /// Names of other constants.
    paths: bool,
    /// Numbers that are neither neutral nor small integers.
    chosen: bool,
}

impl Content {
    fn read(&mut self, tokens: TokenStream) {
        for token in tokens {
            match token {
                TokenTree::Group(group) => self.read(group.stream()),
                TokenTree::Literal(literal) => match Lit::new(literal) {
                    Lit::Float(float) => {
                        self.floats = true;
                        self.chosen |= !float.base10_parse().is_ok_and(|value: f64| NEUTRAL.contains(&value));
                    }
                    Lit::Int(integer) => {
                        self.integers = true;
                        self.chosen |= !integer.base10_parse().is_ok_and(|value: u64| value <= 2);
                    }
                    _ => self.texts = true,
                },
                TokenTree::Ident(name) => {
                    let name = name.to_string();
                    self.paths |= name.len() > 1
                        && name.chars().all(|c| c.is_ascii_uppercase() || c == '_' || c.is_ascii_digit());
                }
                TokenTree::Punct(_) => {}
            }
        }
    }
}

/// The name of a type, the function and its value if an implementation of `Default` chooses numbers.
fn default_of(item: &syn::ItemImpl) -> Option<(String, &syn::ImplItemFn, &Expr)> {
    let [syn::ImplItem::Fn(function)] = item.items.as_slice() else { return None };
    let [syn::Stmt::Expr(value @ Expr::Struct(_), None)] = function.block.stmts.as_slice() else {
        return None;
    };
    let mut content = Content::default();
    content.read(value.to_token_stream());
    let name = item.self_ty.to_token_stream().to_string();
    (function.sig.ident == "default" && content.floats && content.chosen).then_some((name, function, value))
}

/// Whether a type consists of numbers: an index (an alias of `usize`) and a list of bytes do not count.
fn is_number(typed: &Type) -> bool {
    let numbers = ["f64", "f32", "usize", "i32", "i64", "u32", "u64"];
    let mut idents = Vec::new();
    fn read(tokens: TokenStream, found: &mut Vec<String>) {
        for token in tokens {
            match token {
                TokenTree::Group(group) => read(group.stream(), found),
                TokenTree::Ident(ident) => found.push(ident.to_string()),
                _ => {}
            }
        }
    }
    read(typed.to_token_stream(), &mut idents);
    idents.iter().any(|ident| numbers.contains(&ident.as_str()))
}

fn is_for_tests(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        attribute.path().is_ident("cfg") && attribute.to_token_stream().to_string().contains("test")
    })
}

/// The text of a documentation comment, on one line.
fn comment(attributes: &[Attribute]) -> String {
    let mut lines = Vec::new();
    for attribute in attributes {
        if let syn::Meta::NameValue(pair) = &attribute.meta
            && pair.path.is_ident("doc")
            && let Expr::Lit(line) = &pair.value
            && let Lit::Str(line) = &line.lit
        {
            lines.push(line.value().trim().to_owned());
        }
    }
    lines.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(text: &str) -> Vec<(String, String, Option<Kind>)> {
        let found = numbers(text).unwrap();
        found.constants.into_iter().map(|found| (found.name, found.value, found.kind)).collect()
    }

    #[test]
    fn constants_in_blocks_functions_modules_and_fields_are_found_and_texts_and_tests_are_none() {
        let text = "
            /// Share. Bound: of a thing.
            const SHARE: f64 = 0.7;
            const NAME: &str = \"9\";
            struct S; impl S { /// Judgement: none.
                const INNER: usize = 9; }
            mod inner { static LENGTHS: [f64; 2] = [3.0, 4.0]; }
            fn f() { const LOCAL: f64 = 0.1 * SHARE; }
            const HALF: f64 = 0.5 * SHARE;
            /// Source: a book.
            const BOTH: Pair = Pair {
                // Calibrated: by
                // hand.
                a: 3.0,
 b: 4.0, name: \"x\" };
            impl Default for Limits { fn default() -> Self { Limits {
                // Bound: patience.
                long_s: 9.0, name: None } } }
            #[cfg(test)] mod tests { const TESTED: f64 = 3.0; }";
        let named = |name: &str, value: &str, kind| (name.to_owned(), value.to_owned(), kind);
        let expected = [
            named("SHARE", "0.7", Some(Kind::Bound)),
            named("INNER", "9", Some(Kind::Judgement)),
            named("LENGTHS", "[3.0, 4.0]", None),
            named("LOCAL", "0.1 * SHARE", None),
            named("HALF", "0.5 * SHARE", Some(Kind::Derived)),
            named("BOTH.a", "3.0", Some(Kind::Calibrated)),
            named("BOTH.b", "4.0", Some(Kind::Source)),
            named("Limits.long_s", "9.0", Some(Kind::Bound)),
        ];
        assert_eq!(rows(text), expected);
    }

    #[test]
    fn literals_outside_constants_are_found_and_neutral_and_formatted_ones_are_not() {
        let text = "fn f(x: f64) -> f64 {\n vec![3.0 * x];\n println!(\"{}\", 100.0 * x);\n -2.0 * x.max(1e-9) + 1.0 }\n\
                    #[test] fn t() {}\n#[cfg(test)] mod tests { fn g() -> f64 { 7.0 } }";
        let found: Vec<_> =
            numbers(text).unwrap().literals.iter().map(|found| (found.line, found.value)).collect();
        assert_eq!(found, [(2, 3.0), (4, 1e-9)]);
    }
}
