//! Tokens of an IDL text, taken one after the other.

use super::lexer::{Token, TokenKind};

/// Line number and reason of an error.
pub(super) type LineError = (usize, String);

/// Tokens that were not taken yet.
pub(super) struct TokenStream<'t, 'a>(&'t [Token<'a>]);

impl<'t, 'a> TokenStream<'t, 'a> {
    pub(super) fn of(tokens: &'t [Token<'a>]) -> Self {
        Self(tokens)
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Parses a constant expression, up to a symbol that cannot be part of one. A single name or number is returned as
    /// written, numbers in decimal.
    pub(super) fn expression(&mut self) -> String {
        let mut text = String::new();
        while let Some(kind) = self.peek() {
            match kind {
                TokenKind::Symbol(',' | ';' | ']' | '>' | '}' | ')') => break,
                TokenKind::Number(number) => text += &decimal(number),
                TokenKind::Word(word) => text += word,
                TokenKind::Scope => text += "::",
                TokenKind::Quoted => text += "\"",
                TokenKind::Symbol(symbol) => text.push(symbol),
            }
            self.next();
        }
        text
    }

    /// Tokens up to the closing parenthesis.
    pub(super) fn arguments(&mut self) -> Vec<Token<'a>> {
        let mut found = Vec::new();
        let mut depth = 1_usize;
        while let Some(token) = self.next() {
            match token.kind {
                TokenKind::Symbol('(') => depth += 1,
                TokenKind::Symbol(')') if depth == 1 => break,
                TokenKind::Symbol(')') => depth -= 1,
                _ => {}
            }
            found.push(token);
        }
        found
    }

    /// A name with its scopes.
    pub(super) fn scoped(&mut self) -> Result<String, LineError> {
        let mut name = String::new();
        loop {
            if self.peek() == Some(TokenKind::Scope) {
                self.next();
                name += "::";
            }
            name += self.word()?;
            if self.peek() != Some(TokenKind::Scope) {
                return Ok(name);
            }
        }
    }

    /// The next token, which stays.
    pub(super) fn peek(&self) -> Option<TokenKind<'a>> {
        self.0.first().map(|token| token.kind)
    }

    /// Takes the next token.
    pub(super) fn next(&mut self) -> Option<Token<'a>> {
        let (first, rest) = self.0.split_first()?;
        // Without a token left, a fault has line 0.
        self.0 = rest;
        Some(*first)
    }

    /// Takes a name.
    pub(super) fn word(&mut self) -> Result<&'a str, LineError> {
        match self.peek() {
            Some(TokenKind::Word(word)) => {
                self.next();
                Ok(word)
            }
            found => Err(self.fault(format!("expected a name, found {}", named(found)))),
        }
    }

    /// Takes this word, if it is next.
    pub(super) fn keyword(&mut self, word: &str) -> bool {
        let found = self.peek() == Some(TokenKind::Word(word));
        if found {
            self.next();
        }
        found
    }

    /// Takes this symbol, if it is next.
    pub(super) fn symbol(&mut self, symbol: char) -> bool {
        let found = self.peek() == Some(TokenKind::Symbol(symbol));
        if found {
            self.next();
        }
        found
    }

    /// Takes this symbol, which must be next.
    pub(super) fn expect(&mut self, symbol: char) -> Result<(), LineError> {
        if self.symbol(symbol) {
            return Ok(());
        }
        Err(self.fault(format!("expected `{symbol}`, found {}", named(self.peek()))))
    }

    /// An error at the next token.
    pub(super) fn fault(&self, why: impl Into<String>) -> LineError {
        (self.0.first().map_or(0, |token| token.line), why.into())
    }
}

fn named(token: Option<TokenKind<'_>>) -> String {
    match token {
        None => "the end".to_owned(),
        Some(TokenKind::Word(text) | TokenKind::Number(text)) => format!("`{text}`"),
        Some(TokenKind::Quoted) => "a text".to_owned(),
        Some(TokenKind::Scope) => "`::`".to_owned(),
        Some(TokenKind::Symbol(symbol)) => format!("`{symbol}`"),
    }
}

/// Decimal form of a number: `0x10` and `020` become `16`; text that is not a whole number stays.
fn decimal(number: &str) -> String {
    let parsed = match number.strip_prefix("0x").or_else(|| number.strip_prefix("0X")) {
        Some(hexadecimal) => u64::from_str_radix(hexadecimal, 16),
        None if number.len() > 1 && number.starts_with('0') => u64::from_str_radix(number, 8),
        None => number.parse(),
    };
    parsed.map_or_else(|_| number.to_owned(), |number| number.to_string())
}
