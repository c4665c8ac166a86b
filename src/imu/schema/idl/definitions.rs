//! Definitions of an IDL text, by name.

use std::collections::BTreeMap;

use crate::imu::schema::layout::Evolution;
use crate::imu::schema::layout::Number;

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
