//! Lexer of IDL text: words and symbols. Comments, preprocessor lines, and the lines with which recorders separate the
//! files of a `ros2idl` schema are dropped.

/// A word or symbol, and its line, from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Token<'a> {
    pub(super) kind: TokenKind<'a>,
    pub(super) line: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TokenKind<'a> {
    Word(&'a str),
    Number(&'a str),
    /// Text or character in quotes.
    Quoted,
    /// `::`
    Scope,
    Symbol(char),
}

/// All tokens, or the line of a comment or text that never ends.
pub(super) fn tokens(text: &str) -> Result<Vec<Token<'_>>, usize> {
    let mut lexer = Lexer { rest: text, line: 1, tokens: Vec::new() };
    lexer.all()?;
    Ok(lexer.tokens)
}

struct Lexer<'a> {
    rest: &'a str,
    line: usize,
    tokens: Vec<Token<'a>>,
}

impl<'a> Lexer<'a> {
    fn all(&mut self) -> Result<(), usize> {
        let mut fresh = true;
        while let Some(first) = self.rest.chars().next() {
            if first == '\n' {
                self.take(1);
                fresh = true;
            } else if first.is_whitespace() || first == '\u{feff}' {
                self.take(first.len_utf8());
            } else if fresh && self.is_aside() {
                self.aside();
            } else if self.rest.starts_with("//") {
                self.take_while(|c| c != '\n');
            } else if self.rest.starts_with("/*") {
                let end = self.rest.find("*/").ok_or(self.line)?;
                self.take(end + 2);
            } else {
                fresh = false;
                self.token(first)?;
            }
        }
        Ok(())
    }

    /// Whether the line that begins here is not IDL.
    fn is_aside(&self) -> bool {
        let line = self.rest.lines().next().unwrap_or_default().trim_end();
        line.starts_with('#') || line.starts_with("IDL:") || line.len() >= 3 && line.bytes().all(|byte| byte == b'=')
    }

    /// Drops a line and its continuation lines.
    fn aside(&mut self) {
        while self.take_while(|c| c != '\n').trim_end().ends_with('\\') {
            self.take(self.rest.len().min(1));
        }
    }

    fn token(&mut self, first: char) -> Result<(), usize> {
        let line = self.line;
        let kind = match first {
            '"' | '\'' => {
                self.take(1);
                let mut escaped = false;
                let inside = |c: char| {
                    let goes_on = escaped || c != first;
                    escaped = !escaped && c == '\\';
                    goes_on
                };
                self.take_while(inside);
                if self.rest.is_empty() {
                    return Err(line);
                }
                self.take(1);
                TokenKind::Quoted
            }
            '0'..='9' => TokenKind::Number(self.take_while(|c| c.is_ascii_alphanumeric() || c == '.')),
            c if is_in_word(c) => TokenKind::Word(self.take_while(is_in_word)),
            ':' if self.rest.starts_with("::") => {
                self.take(2);
                TokenKind::Scope
            }
            symbol => {
                self.take(symbol.len_utf8());
                TokenKind::Symbol(symbol)
            }
        };
        self.tokens.push(Token { kind, line });
        Ok(())
    }

    fn take_while(&mut self, mut inside: impl FnMut(char) -> bool) -> &'a str {
        let end = self.rest.find(|c| !inside(c)).unwrap_or(self.rest.len());
        self.take(end)
    }

    fn take(&mut self, len: usize) -> &'a str {
        let (taken, rest) = self.rest.split_at(len);
        self.line += taken.matches('\n').count();
        self.rest = rest;
        taken
    }
}

fn is_in_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}
