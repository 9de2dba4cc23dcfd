//! What one file says: its child modules, what it imports, and which paths it names.

use crate::lexer::{Token, tokens};

/// What one file says.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Mentions {
    /// Modules in files of their own.
    pub(crate) children: Vec<String>,
    /// Names that `use` brings into the file.
    pub(crate) imports: Vec<Import>,
    /// Paths of two or more words outside of `use`.
    pub(crate) paths: Vec<Vec<String>>,
}

/// One name of a `use`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Import {
    /// The name in this file; `*` for all names.
    pub(crate) name: String,
    /// Where it comes from, without the `*`.
    pub(crate) path: Vec<String>,
    /// Whether others may take it from here by its name.
    pub(crate) is_reexport: bool,
}

/// Reads a file; what `#[cfg(test)]` is in front of does not count.
pub(crate) fn mentions(source: &str) -> Mentions {
    let tokens = tokens(source);
    let mut found = Mentions::default();
    let mut at = 0;
    let mut is_public = false;
    while at < tokens.len() {
        let rest = &tokens[at..];
        at += match rest {
            [mark, open, ..] if mark.is('#') && open.is('[') => {
                let attribute = bracketed(&rest[1..]) + 1;
                if is_for_tests(&rest[..attribute]) {
                    attribute + item(&rest[attribute..])
                } else {
                    attribute
                }
            }
            [Token::Word(word), Token::Word(name), end, ..] if word == "mod" && end.is(';') => {
                found.children.push(name.clone());
                3
            }
            [Token::Word(word), ..] if word == "use" => {
                let length = rest.iter().take_while(|token| !token.is(';')).count();
                imports(&rest[1..length], &mut Vec::new(), is_public, &mut found.imports);
                length
            }
            [Token::Word(word), ..] if word == "pub" => {
                is_public = true;
                at += 1;
                at += if tokens.get(at).is_some_and(|token| token.is('(')) {
                    bracketed(&tokens[at..])
                } else {
                    0
                };
                continue;
            }
            [Token::Word(_), Token::PathSeparator, ..] => {
                let path = path(rest);
                let length = 2 * path.len() - 1;
                found.paths.push(path);
                length
            }
            _ => 1,
        };
        is_public = false;
    }
    found
}

/// The words of a path at the beginning of `tokens`.
fn path(tokens: &[Token]) -> Vec<String> {
    let mut words = Vec::new();
    let mut at = 0;
    while let Some(Token::Word(word)) = tokens.get(at) {
        words.push(word.clone());
        if tokens.get(at + 1) != Some(&Token::PathSeparator) {
            break;
        }
        at += 2;
    }
    words
}

/// Number of tokens from an opening bracket to its closing one.
fn bracketed(tokens: &[Token]) -> usize {
    let mut depth = 0;
    for (at, token) in tokens.iter().enumerate() {
        match token {
            Token::Sign('(' | '[' | '{') => depth += 1,
            Token::Sign(')' | ']' | '}') => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return at + 1;
        }
    }
    tokens.len()
}

fn is_for_tests(attribute: &[Token]) -> bool {
    let words: Vec<&str> = attribute.iter().filter_map(Token::word).collect();
    words == ["cfg", "test"]
}

/// Number of tokens of the item at the beginning: up to its `;` or the end of its braces.
fn item(tokens: &[Token]) -> usize {
    let mut at = 0;
    while at < tokens.len() {
        match tokens[at] {
            Token::Sign(';') => return at + 1,
            Token::Sign('{') => return at + bracketed(&tokens[at..]),
            Token::Sign('(' | '[') => at += bracketed(&tokens[at..]),
            _ => at += 1,
        }
    }
    at
}

/// Collects the names of one tree of a `use`, which hangs at `prefix`.
fn imports(tree: &[Token], prefix: &mut Vec<String>, is_reexport: bool, found: &mut Vec<Import>) {
    let depth = prefix.len();
    let mut rest = tree;
    loop {
        match rest {
            [Token::Word(word), Token::PathSeparator, ..] => {
                prefix.push(word.clone());
                rest = &rest[2..];
            }
            [Token::Word(word), Token::Word(keyword), Token::Word(name)] if keyword == "as" => {
                prefix.push(word.clone());
                found.push(Import { name: name.clone(), path: prefix.clone(), is_reexport });
                break;
            }
            [Token::Word(word)] => {
                // `use a::{self}` is `use a`.
                if word != "self" {
                    prefix.push(word.clone());
                }
                let name = prefix.last().cloned().unwrap_or_default();
                found.push(Import { name, path: prefix.clone(), is_reexport });
                break;
            }
            [star] if star.is('*') => {
                found.push(Import { name: "*".to_owned(), path: prefix.clone(), is_reexport });
                break;
            }
            [open, inner @ .., _] if open.is('{') => {
                for branch in branches(inner) {
                    imports(branch, prefix, is_reexport, found);
                }
                break;
            }
            _ => break,
        }
    }
    prefix.truncate(depth);
}

/// The parts between commas that are in no inner braces.
fn branches(tokens: &[Token]) -> Vec<&[Token]> {
    let mut depth = 0;
    let parts = tokens.split(|token| {
        match token {
            Token::Sign('{') => depth += 1,
            Token::Sign('}') => depth -= 1,
            _ => {}
        }
        depth == 0 && token.is(',')
    });
    parts.filter(|part| !part.is_empty()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn import(name: &str, path: &str, is_reexport: bool) -> Import {
        Import { name: name.into(), path: path.split("::").map(str::to_owned).collect(), is_reexport }
    }

    #[test]
    fn a_tree_of_imports_is_taken_apart() {
        let found = mentions("use crate::{a::{B, c::{self, D as E}}, f::*}; pub(crate) use g::H;");
        let expected = [
            import("B", "crate::a::B", false),
            import("c", "crate::a::c", false),
            import("E", "crate::a::c::D", false),
            import("*", "crate::f", false),
            import("H", "g::H", true),
        ];
        assert_eq!(found.imports, expected);
        assert!(found.paths.is_empty());
    }

    #[test]
    fn paths_in_bodies_count() {
        let found = mentions("fn f() -> super::A { let x = crate::b::C::new(D::E); x.y::<z>() }");
        let expected: [&[&str]; 3] = [&["super", "A"], &["crate", "b", "C", "new"], &["D", "E"]];
        // The method y and what is in its brackets are no path of a module.
        let words: Vec<Vec<&str>> =
            found.paths.iter().map(|p| p.iter().map(String::as_str).collect()).collect();
        assert_eq!(words[..3], expected);
    }

    #[test]
    fn tests_do_not_count() {
        let source = "mod a; #[cfg(test)] mod tests; #[cfg(test)] use crate::b::C; #[cfg(test)] mod more { use crate::d::E; }
            #[cfg(test)] #[derive(Debug)] fn f(g: [u8; 2]) { crate::h::i() } pub mod j;";
        let found = mentions(source);
        assert_eq!(found.children, ["a", "j"]);
        assert_eq!(found, Mentions { children: found.children.clone(), ..Mentions::default() });
    }
}
