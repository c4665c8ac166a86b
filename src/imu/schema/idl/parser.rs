//! Parser of the definitions in IDL text, as far as they determine the layout of data (OMG IDL 4.2, with the annotations of
//! DDS-XTypes 1.3 that change the bytes). [`resolver`](super::resolver) resolves names and refuses unsupported
//! definitions, so that those which nobody needs do no harm.

use std::collections::btree_map::Entry;

use super::definitions::{Definition, IdlDefinitions, Struct, Type};
use super::lexer::{TokenKind, tokens};
use super::token_stream::{LineError, TokenStream};
use crate::imu::schema::layout::{Evolution, Number};

/// Parses all definitions in `text`.
pub(super) fn parse(text: &str) -> Result<IdlDefinitions, LineError> {
    let tokens = tokens(text).map_err(|line| (line, "a comment or text that never ends".to_owned()))?;
    let mut parser = Parser { tokens: TokenStream::of(&tokens), scope: Vec::new(), definitions: IdlDefinitions::new() };
    while !parser.tokens.is_empty() {
        parser.definition()?;
    }
    match parser.scope.last() {
        None => Ok(parser.definitions),
        Some(module) => Err(parser.tokens.fault(format!("module {module} never ends"))),
    }
}

struct Parser<'t, 'a> {
    tokens: TokenStream<'t, 'a>,
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
        if self.tokens.symbol('}') {
            if self.scope.pop().is_none() {
                return Err(self.tokens.fault("a } too many"));
            }
            self.tokens.symbol(';');
            return Ok(());
        }
        if self.tokens.symbol(';') {
            return Ok(());
        }
        let annotations = self.annotations()?;
        match self.tokens.word()? {
            "module" => {
                let name = self.tokens.word()?;
                self.scope.push(name);
                self.tokens.expect('{')
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
                let name = self.tokens.word()?.to_owned();
                self.tokens.expect('=')?;
                let value = self.tokens.expression();
                self.tokens.expect(';')?;
                self.define(&name, Definition::Constant(value.parse().ok()))
            }
            kind @ ("union" | "bitmask" | "bitset" | "interface" | "valuetype" | "exception" | "native") => {
                self.unread(kind)
            }
            other => Err(self.tokens.fault(format!("expected a definition, found `{other}`"))),
        }
    }

    fn structure(&mut self, annotations: &Annotations) -> Result<(), LineError> {
        let name = self.tokens.word()?.to_owned();
        if self.tokens.symbol(';') {
            return Ok(());
        }
        let base = if self.tokens.symbol(':') { Some(self.tokens.scoped()?) } else { None };
        let mut structure = Struct { base, members: Vec::new(), evolution: annotations.evolution };
        let mut refused = annotations.refused.map(|why| format!("{name} is {why}, which is not read"));
        self.tokens.expect('{')?;
        while !self.tokens.symbol('}') {
            let annotations = self.annotations()?;
            let base = self.kind(0)?;
            let members = self.declarators(&base)?;
            if let (None, Some(why), Some((member, _))) = (&refused, annotations.refused, members.first()) {
                refused = Some(format!("`{member}` of {name} is {why}, which is not read"));
            }
            structure.members.extend(members);
        }
        self.tokens.symbol(';');
        let definition = refused.map_or(Definition::Struct(structure), Definition::Unread);
        self.define(&name, definition)
    }

    fn enumeration(&mut self, annotations: &Annotations) -> Result<(), LineError> {
        let name = self.tokens.word()?.to_owned();
        self.tokens.expect('{')?;
        while !self.tokens.symbol('}') {
            self.annotations()?;
            self.tokens.word()?;
            if self.tokens.symbol('=') {
                self.tokens.expression();
            }
            self.tokens.symbol(',');
        }
        self.tokens.symbol(';');
        let number = match annotations.bits {
            Some(..=8) => Number::I8,
            Some(..=16) => Number::I16,
            _ => Number::I32,
        };
        self.define(&name, Definition::Enum(number))
    }

    /// Skips an unsupported definition.
    fn unread(&mut self, kind: &str) -> Result<(), LineError> {
        let name = self.tokens.word()?.to_owned();
        let mut depth = 0_usize;
        while let Some(token) = self.tokens.next() {
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
            return Err(self.tokens.fault("sequences are nested too deeply"));
        }
        if self.tokens.peek() == Some(TokenKind::Scope) {
            return Ok(Type::Named(self.tokens.scoped()?));
        }
        let word = match self.tokens.peek() {
            Some(TokenKind::Word(word)) => word,
            _ => self.tokens.word()?,
        };
        let number = |number| Ok(Type::Number(number));
        let unread = |what: &str| Ok(Type::Unread(format!("a {what}, which is not read")));
        match word {
            "sequence" => {
                self.tokens.next();
                self.tokens.expect('<')?;
                let element = self.kind(depth + 1)?;
                if self.tokens.symbol(',') {
                    self.tokens.expression();
                }
                self.tokens.expect('>')?;
                return Ok(Type::Sequence(Box::new(element)));
            }
            "string" | "wstring" => {
                self.tokens.next();
                if self.tokens.symbol('<') {
                    self.tokens.expression();
                    self.tokens.expect('>')?;
                }
                return Ok(if word == "string" { Type::Text } else { Type::WideText });
            }
            "map" | "fixed" => {
                while self.tokens.next().is_some_and(|token| token.kind != TokenKind::Symbol('>')) {}
                return unread(word);
            }
            "unsigned" | "long" | "short" | "float" | "double" | "char" | "octet" | "boolean" | "int8" | "uint8"
            | "int16" | "uint16" | "int32" | "uint32" | "int64" | "uint64" | "wchar" | "any" => {}
            _ => return Ok(Type::Named(self.tokens.scoped()?)),
        }
        self.tokens.next();
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
            "long" if self.tokens.keyword("long") => number(Number::I64),
            "long" if self.tokens.keyword("double") => unread("long double"),
            "long" => number(Number::I32),
            "unsigned" if self.tokens.keyword("short") => number(Number::U16),
            "unsigned" if self.tokens.keyword("long") => {
                number(if self.tokens.keyword("long") { Number::U64 } else { Number::U32 })
            }
            other => unread(other),
        }
    }

    /// Parses `a, b[3]` up to the semicolon.
    fn declarators(&mut self, base: &Type) -> Result<Vec<(String, Type)>, LineError> {
        let mut declared = Vec::new();
        loop {
            let name = self.tokens.word()?.to_owned();
            let mut dimensions = Vec::new();
            while self.tokens.symbol('[') {
                dimensions.push(self.tokens.expression());
                self.tokens.expect(']')?;
            }
            let kind = match dimensions.is_empty() {
                true => base.clone(),
                false => Type::Array(Box::new(base.clone()), dimensions),
            };
            declared.push((name, kind));
            if self.tokens.symbol(';') {
                return Ok(declared);
            }
            self.tokens.expect(',')?;
        }
    }

    fn annotations(&mut self) -> Result<Annotations, LineError> {
        let mut found = Annotations::default();
        while self.tokens.symbol('@') {
            let name = self.tokens.scoped()?;
            let arguments = if self.tokens.symbol('(') { self.tokens.arguments() } else { Vec::new() };
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

    /// Adds a definition. Recorders repeat definitions; two different ones are a contradiction.
    fn define(&mut self, name: &str, definition: Definition) -> Result<(), LineError> {
        let name = [self.scope.as_slice(), &[name]].concat().join("::");
        match self.definitions.entry(name) {
            Entry::Vacant(vacant) => drop(vacant.insert(definition)),
            Entry::Occupied(present) if *present.get() == definition => {}
            Entry::Occupied(present) => {
                let why = format!("{} is defined twice, differently", present.key());
                return Err(self.tokens.fault(why));
            }
        }
        Ok(())
    }
}
