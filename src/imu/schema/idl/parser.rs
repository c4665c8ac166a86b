//! Definitions in IDL text, as far as they determine the layout of data (OMG IDL 4.2, with the annotations of
//! DDS-XTypes 1.3 that change the bytes). [`resolver`](super::resolver) resolves names and refuses unsupported
//! definitions, so that those which nobody needs do no harm.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use super::lexer::{Token, TokenKind, tokens};
use crate::imu::schema::layout::{Evolution, Number};

/// Definitions by scoped name, `pkg::msg::Type`.
pub(super) type IdlDefinitions = BTreeMap<String, Definition>;

#[derive(Clone, Debug, PartialEq)]
pub(super) enum Definition {
    Struct(Struct),
    Alias(Type),
    /// Enumeration, by the number type that encodes it.
    Enum(Number),
    /// Constant, with its value if that can be the size of an array.
    Constant(Option<u32>),
    /// Unsupported definition, with the reason.
    Unread(String),
}

#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Struct {
    pub(super) base: Option<String>,
    pub(super) members: Vec<(String, Type)>,
    pub(super) evolution: Evolution,
}

#[derive(Clone, Debug, PartialEq)]
pub(super) enum Type {
    Number(Number),
    Text,
    WideText,
    Named(String),
    Sequence(Box<Type>),
    /// Array with its dimensions: numbers, or names of constants.
    Array(Box<Type>, Vec<String>),
    Unread(String),
}

/// Line number and reason of an error.
pub(super) type LineError = (usize, String);

/// Parses all definitions in `text`.
pub(super) fn parse(text: &str) -> Result<IdlDefinitions, LineError> {
    let tokens = tokens(text).map_err(|line| (line, "a comment or text that never ends".to_owned()))?;
    let mut parser = Parser { tokens: &tokens, scope: Vec::new(), definitions: IdlDefinitions::new() };
    while !parser.tokens.is_empty() {
        parser.definition()?;
    }
    match parser.scope.last() {
        None => Ok(parser.definitions),
        Some(module) => Err(parser.fault(format!("module {module} never ends"))),
    }
}

struct Parser<'t, 'a> {
    tokens: &'t [Token<'a>],
    scope: Vec<&'a str>,
    definitions: IdlDefinitions,
}

/// Annotations that affect the bytes.
#[derive(Default)]
struct Annotations {
    evolution: Evolution,
    bits: Option<u32>,
    refused: Option<&'static str>,
}

/// Greatest depth of nested sequences: real schemas have less.
const MAX_DEPTH: usize = 16;

impl<'a> Parser<'_, 'a> {
    /// Parses a definition, or the end of a module.
    fn definition(&mut self) -> Result<(), LineError> {
        if self.symbol('}') {
            if self.scope.pop().is_none() {
                return Err(self.fault("a } too many"));
            }
            self.symbol(';');
            return Ok(());
        }
        if self.symbol(';') {
            return Ok(());
        }
        let annotations = self.annotations()?;
        match self.word()? {
            "module" => {
                let name = self.word()?;
                self.scope.push(name);
                self.expect('{')
            }
            "struct" => self.structure(&annotations),
            "enum" => self.enumeration(&annotations),
            "typedef" => {
                let base = self.kind(0)?;
                for (name, kind) in self.declarators(&base)? {
                    self.define(&name, Definition::Alias(kind))?;
                }
                Ok(())
            }
            "const" => {
                self.kind(0)?;
                let name = self.word()?.to_owned();
                self.expect('=')?;
                let value = self.expression();
                self.expect(';')?;
                self.define(&name, Definition::Constant(value.parse().ok()))
            }
            kind @ ("union" | "bitmask" | "bitset" | "interface" | "valuetype" | "exception" | "native") => {
                self.unread(kind)
            }
            other => Err(self.fault(format!("expected a definition, found `{other}`"))),
        }
    }

    fn structure(&mut self, annotations: &Annotations) -> Result<(), LineError> {
        let name = self.word()?.to_owned();
        if self.symbol(';') {
            return Ok(());
        }
        let base = if self.symbol(':') { Some(self.scoped()?) } else { None };
        let mut structure = Struct { base, members: Vec::new(), evolution: annotations.evolution };
        let mut refused = annotations.refused.map(|why| format!("{name} is {why}, which is not read"));
        self.expect('{')?;
        while !self.symbol('}') {
            let annotations = self.annotations()?;
            let base = self.kind(0)?;
            let members = self.declarators(&base)?;
            if let (None, Some(why), Some((member, _))) = (&refused, annotations.refused, members.first()) {
                refused = Some(format!("`{member}` of {name} is {why}, which is not read"));
            }
            structure.members.extend(members);
        }
        self.symbol(';');
        let definition = refused.map_or(Definition::Struct(structure), Definition::Unread);
        self.define(&name, definition)
    }

    fn enumeration(&mut self, annotations: &Annotations) -> Result<(), LineError> {
        let name = self.word()?.to_owned();
        self.expect('{')?;
        while !self.symbol('}') {
            self.annotations()?;
            self.word()?;
            if self.symbol('=') {
                self.expression();
            }
            self.symbol(',');
        }
        self.symbol(';');
        let number = match annotations.bits {
            Some(..=8) => Number::I8,
            Some(..=16) => Number::I16,
            _ => Number::I32,
        };
        self.define(&name, Definition::Enum(number))
    }

    /// Skips an unsupported definition.
    fn unread(&mut self, kind: &str) -> Result<(), LineError> {
        let name = self.word()?.to_owned();
        let mut depth = 0_usize;
        while let Some(token) = self.next() {
            match token.kind {
                TokenKind::Symbol('{') => depth += 1,
                TokenKind::Symbol('}') => depth = depth.saturating_sub(1),
                TokenKind::Symbol(';') if depth == 0 => break,
                _ => {}
            }
        }
        self.define(&name, Definition::Unread(format!("{name} is a {kind}, which is not read")))
    }

    fn kind(&mut self, depth: usize) -> Result<Type, LineError> {
        if depth > MAX_DEPTH {
            return Err(self.fault("sequences are nested too deeply"));
        }
        if self.peek() == Some(TokenKind::Scope) {
            return Ok(Type::Named(self.scoped()?));
        }
        let word = match self.peek() {
            Some(TokenKind::Word(word)) => word,
            _ => self.word()?,
        };
        let number = |number| Ok(Type::Number(number));
        let unread = |what: &str| Ok(Type::Unread(format!("a {what}, which is not read")));
        match word {
            "sequence" => {
                self.next();
                self.expect('<')?;
                let element = self.kind(depth + 1)?;
                if self.symbol(',') {
                    self.expression();
                }
                self.expect('>')?;
                return Ok(Type::Sequence(Box::new(element)));
            }
            "string" | "wstring" => {
                self.next();
                if self.symbol('<') {
                    self.expression();
                    self.expect('>')?;
                }
                return Ok(if word == "string" { Type::Text } else { Type::WideText });
            }
            "map" | "fixed" => {
                while self.next().is_some_and(|token| token.kind != TokenKind::Symbol('>')) {}
                return unread(word);
            }
            "unsigned" | "long" | "short" | "float" | "double" | "char" | "octet" | "boolean" | "int8" | "uint8"
            | "int16" | "uint16" | "int32" | "uint32" | "int64" | "uint64" | "wchar" | "any" => {}
            _ => return Ok(Type::Named(self.scoped()?)),
        }
        self.next();
        match word {
            "boolean" => number(Number::Bool),
            "int8" => number(Number::I8),
            "octet" | "char" | "uint8" => number(Number::U8),
            "short" | "int16" => number(Number::I16),
            "uint16" => number(Number::U16),
            "int32" => number(Number::I32),
            "uint32" => number(Number::U32),
            "int64" => number(Number::I64),
            "uint64" => number(Number::U64),
            "float" => number(Number::F32),
            "double" => number(Number::F64),
            "long" if self.keyword("long") => number(Number::I64),
            "long" if self.keyword("double") => unread("long double"),
            "long" => number(Number::I32),
            "unsigned" if self.keyword("short") => number(Number::U16),
            "unsigned" if self.keyword("long") => number(if self.keyword("long") { Number::U64 } else { Number::U32 }),
            other => unread(other),
        }
    }

    /// Parses `a, b[3]` up to the semicolon.
    fn declarators(&mut self, base: &Type) -> Result<Vec<(String, Type)>, LineError> {
        let mut declared = Vec::new();
        loop {
            let name = self.word()?.to_owned();
            let mut dimensions = Vec::new();
            while self.symbol('[') {
                dimensions.push(self.expression());
                self.expect(']')?;
            }
            let kind = match dimensions.is_empty() {
                true => base.clone(),
                false => Type::Array(Box::new(base.clone()), dimensions),
            };
            declared.push((name, kind));
            if self.symbol(';') {
                return Ok(declared);
            }
            self.expect(',')?;
        }
    }

    /// Parses a constant expression, up to a symbol that cannot be part of one. A single name or number is returned as
    /// written, numbers in decimal.
    fn expression(&mut self) -> String {
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

    fn annotations(&mut self) -> Result<Annotations, LineError> {
        let mut found = Annotations::default();
        while self.symbol('@') {
            let name = self.scoped()?;
            let arguments = if self.symbol('(') { self.arguments() } else { Vec::new() };
            let says = |word| arguments.iter().any(|token| token.kind == TokenKind::Word(word));
            match name.as_str() {
                "final" => found.evolution = Evolution::Final,
                "appendable" => found.evolution = Evolution::Appendable,
                "mutable" => found.refused = Some("@mutable"),
                "extensibility" if says("FINAL") => found.evolution = Evolution::Final,
                "extensibility" if says("APPENDABLE") => found.evolution = Evolution::Appendable,
                "extensibility" if says("MUTABLE") => found.refused = Some("@mutable"),
                "optional" if !says("FALSE") => found.refused = Some("@optional"),
                "bit_bound" => {
                    let bits = arguments.iter().find_map(|token| match token.kind {
                        TokenKind::Number(number) => number.parse().ok(),
                        _ => None,
                    });
                    found.bits = bits;
                }
                _ => {}
            }
        }
        Ok(found)
    }

    /// Tokens up to the closing parenthesis.
    fn arguments(&mut self) -> Vec<Token<'a>> {
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

    fn scoped(&mut self) -> Result<String, LineError> {
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

    /// Adds a definition. Recorders repeat definitions; two different ones are a contradiction.
    fn define(&mut self, name: &str, definition: Definition) -> Result<(), LineError> {
        let name = [self.scope.as_slice(), &[name]].concat().join("::");
        match self.definitions.entry(name) {
            Entry::Vacant(vacant) => drop(vacant.insert(definition)),
            Entry::Occupied(present) if *present.get() == definition => {}
            Entry::Occupied(present) => {
                let why = format!("{} is defined twice, differently", present.key());
                return Err(self.fault(why));
            }
        }
        Ok(())
    }

    fn peek(&self) -> Option<TokenKind<'a>> {
        self.tokens.first().map(|token| token.kind)
    }

    fn next(&mut self) -> Option<Token<'a>> {
        let (first, rest) = self.tokens.split_first()?;
        // Without a token left, a fault has line 0.
        self.tokens = rest;
        Some(*first)
    }

    fn word(&mut self) -> Result<&'a str, LineError> {
        match self.peek() {
            Some(TokenKind::Word(word)) => {
                self.next();
                Ok(word)
            }
            found => Err(self.fault(format!("expected a name, found {}", named(found)))),
        }
    }

    fn keyword(&mut self, word: &str) -> bool {
        let found = self.peek() == Some(TokenKind::Word(word));
        if found {
            self.next();
        }
        found
    }

    fn symbol(&mut self, symbol: char) -> bool {
        let found = self.peek() == Some(TokenKind::Symbol(symbol));
        if found {
            self.next();
        }
        found
    }

    fn expect(&mut self, symbol: char) -> Result<(), LineError> {
        if self.symbol(symbol) {
            return Ok(());
        }
        Err(self.fault(format!("expected `{symbol}`, found {}", named(self.peek()))))
    }

    fn fault(&self, why: impl Into<String>) -> LineError {
        (self.tokens.first().map_or(0, |token| token.line), why.into())
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
