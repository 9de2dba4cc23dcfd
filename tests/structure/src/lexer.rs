//! Rust sources as a list of tokens, as far as paths need them.

/// One token.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Token {
    /// A word: an identifier or a keyword.
    Word(String),
    /// `::`
    PathSeparator,
    /// Any other sign.
    Sign(char),
}

impl Token {
    /// The word, if it is one.
    pub(crate) fn word(&self) -> Option<&str> {
        match self {
            Self::Word(word) => Some(word),
            _ => None,
        }
    }

    /// Whether this is `sign`.
    pub(crate) fn is(&self, sign: char) -> bool {
        *self == Self::Sign(sign)
    }
}

/// The tokens of `source`, without comments, texts, characters, numbers and lifetimes.
pub(crate) fn tokens(source: &str) -> Vec<Token> {
    let characters: Vec<char> = source.chars().collect();
    let mut tokens = Vec::new();
    let mut at = 0;
    while at < characters.len() {
        let rest = &characters[at..];
        at += match rest {
            ['/', '/', ..] => rest.iter().take_while(|&&c| c != '\n').count(),
            ['/', '*', ..] => block_comment(rest),
            ['"', ..] | ['b', '"', ..] | ['c', '"', ..] => text(rest),
            ['r', '"' | '#', ..] | ['b', 'r', '"' | '#', ..] if is_raw_text(rest) => raw_text(rest),
            ['\'', ..] => character_or_lifetime(rest),
            [':', ':', ..] => {
                tokens.push(Token::PathSeparator);
                2
            }
            [first, ..] if first.is_ascii_digit() => {
                rest.iter().take_while(|c| c.is_alphanumeric() || **c == '_').count()
            }
            [first, ..] if is_word(*first) => {
                let word: String = rest.iter().take_while(|&&c| is_word(c)).collect();
                let length = word.chars().count();
                tokens.push(Token::Word(word));
                length
            }
            [first, ..] => {
                if !first.is_whitespace() {
                    tokens.push(Token::Sign(*first));
                }
                1
            }
            [] => 1,
        };
    }
    tokens
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// Length of a comment between `/*` and `*/`, which may have others inside.
fn block_comment(rest: &[char]) -> usize {
    let (mut depth, mut at) = (0, 0);
    while at < rest.len() {
        match rest[at..] {
            ['/', '*', ..] => (depth, at) = (depth + 1, at + 2),
            ['*', '/', ..] => (depth, at) = (depth - 1, at + 2),
            _ => at += 1,
        }
        if depth == 0 {
            break;
        }
    }
    at
}

/// Length of a text in quotation marks, with the letter before it.
fn text(rest: &[char]) -> usize {
    let mut at = rest.iter().take_while(|&&c| c != '"').count() + 1;
    while at < rest.len() && rest[at] != '"' {
        at += if rest[at] == '\\' { 2 } else { 1 };
    }
    at + 1
}

/// Marks (`#`) before the quotation mark of a raw text.
fn raw_marks(rest: &[char]) -> (usize, usize) {
    let prefix = rest.iter().take_while(|&&c| c == 'b' || c == 'r').count();
    (prefix, rest[prefix..].iter().take_while(|&&c| c == '#').count())
}

fn is_raw_text(rest: &[char]) -> bool {
    let (prefix, marks) = raw_marks(rest);
    rest.get(prefix + marks) == Some(&'"')
}

/// Length of a raw text, up to a quotation mark with as many marks after it as before.
fn raw_text(rest: &[char]) -> usize {
    let (prefix, marks) = raw_marks(rest);
    let mut at = prefix + marks + 1;
    while at < rest.len() {
        if rest[at] == '"' && rest[at + 1..].iter().take_while(|&&c| c == '#').count() >= marks {
            return at + 1 + marks;
        }
        at += 1;
    }
    at
}

/// Length of `'x'`, `'\n'` or `'lifetime`.
fn character_or_lifetime(rest: &[char]) -> usize {
    match rest {
        ['\'', '\\', ..] => 3 + rest[3..].iter().take_while(|&&c| c != '\'').count(),
        ['\'', _, '\'', ..] => 3,
        _ => 1 + rest[1..].iter().take_while(|&&c| is_word(c)).count(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(source: &str) -> Vec<String> {
        tokens(source).iter().filter_map(|token| token.word().map(str::to_owned)).collect()
    }

    #[test]
    fn comments_and_texts_hold_no_words() {
        let source = r##"
            // one two
            /* three /* four */ five */
            let a = "six \" seven"; let b = b"eight"; let c = r#"nine " ten"#; let d = 'e'; let f = '\'';
            fn g<'lifetime>() {}
        "##;
        assert_eq!(words(source), ["let", "a", "let", "b", "let", "c", "let", "d", "let", "f", "fn", "g"]);
    }

    #[test]
    fn words_that_begin_like_texts_are_words() {
        assert_eq!(words("raw r#type branch b c"), ["raw", "r", "type", "branch", "b", "c"]);
    }

    #[test]
    fn separators_are_one_token() {
        let expected = [
            Token::Word("a".into()),
            Token::PathSeparator,
            Token::Word("b".into()),
            Token::Sign(':'),
            Token::Word("f32".into()),
        ];
        assert_eq!(tokens("a::b: f32"), expected);
    }
}
