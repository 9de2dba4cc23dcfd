//! Names of the types that a crate offers.

use std::collections::BTreeSet;

use crate::lexer::tokens;

/// Words before the name of a type.
const KINDS: [&str; 5] = ["struct", "enum", "union", "trait", "type"];

/// Names of the public types that `source` defines at any depth. Associated types, which have no `pub`, do not count, and
/// neither do types for the crate alone.
#[must_use]
pub fn public_types(source: &str) -> BTreeSet<String> {
    let tokens = tokens(source);
    let names = tokens.windows(3).filter_map(|three| match three {
        [visibility, kind, name] if visibility.word() == Some("pub") && KINDS.contains(&kind.word()?) => {
            name.word()
        }
        _ => None,
    });
    names.map(str::to_owned).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_public_types_count() {
        let source = "pub struct A; pub(crate) struct B; struct C; pub enum D { E } // pub struct F;
            pub type G<'a> = H<'a>; impl I for A { type J = u8; } pub fn k() {} pub trait L {}";
        assert_eq!(public_types(source), ["A", "D", "G", "L"].map(str::to_owned).into());
    }
}
