//! IDL definitions resolved to messages: names are looked up from their scope, aliases followed, array sizes computed.

use std::collections::{BTreeMap, BTreeSet};

use super::definitions::{Definition, IdlDefinitions, Struct, Type};
use crate::imu::schema::layout::{Count, Evolution, Field, Kind, Message};

/// Messages that the root needs, the root first; or a description of the problem.
pub(super) fn resolve(schema_name: &str, definitions: &IdlDefinitions) -> Result<Vec<Message>, String> {
    let mut resolver = IdlResolver { definitions, messages: Vec::new(), ids: BTreeMap::new() };
    let root = resolver.root(schema_name)?;
    resolver.message(&root, 0)?;
    Ok(resolver.messages)
}

struct IdlResolver<'a> {
    definitions: &'a IdlDefinitions,
    messages: Vec<Message>,
    /// Ids of the structs met; `None` while a struct is being resolved.
    ids: BTreeMap<String, Option<usize>>,
}

/// Greatest depth of nesting: real schemas have less.
const MAX_DEPTH: usize = 32;

/// Largest number of messages: real schemas have fewer. Lists of lists add messages of their own.
const MAX_MESSAGES: usize = 4096;

impl<'a> IdlResolver<'a> {
    /// Struct that a schema is named after: `pkg/msg/Type`, `pkg::msg::Type`, or the only one of that name.
    fn root(&self, schema_name: &str) -> Result<String, String> {
        let wanted = schema_name.replace('/', "::");
        if self.definitions.contains_key(&wanted) {
            return Ok(wanted);
        }
        let last = wanted.rsplit("::").next().unwrap_or_default();
        let named = |name: &&String| name.rsplit("::").next() == Some(last);
        let mut candidates = self.definitions.keys().filter(named);
        match (candidates.next(), candidates.next()) {
            (Some(only), None) => Ok(only.clone()),
            _ => Err(format!("{wanted} is not defined")),
        }
    }

    fn message(&mut self, name: &str, depth: usize) -> Result<usize, String> {
        match self.ids.get(name) {
            Some(Some(id)) => return Ok(*id),
            Some(None) => return Err(format!("{name} contains itself")),
            None if depth > MAX_DEPTH => return Err(format!("{name} is nested too deeply")),
            None => {}
        }
        let definitions = self.definitions;
        let structure = match definitions.get(name) {
            Some(Definition::Struct(structure)) => structure,
            Some(Definition::Unread(why)) => return Err(why.clone()),
            _ => return Err(format!("{name} is not a struct")),
        };
        self.ids.insert(name.to_owned(), None);
        let id = self.add(Message { name: plain(name), fields: Vec::new(), evolution: structure.evolution })?;
        let mut fields = Vec::new();
        self.members(name, structure, &mut fields, &mut BTreeSet::new(), depth)?;
        if let Some(message) = self.messages.get_mut(id) {
            message.fields = fields;
        }
        self.ids.insert(name.to_owned(), Some(id));
        Ok(id)
    }

    /// Appends the members of a struct, after those of the struct that it inherits from.
    fn members(
        &mut self,
        name: &str,
        own: &'a Struct,
        fields: &mut Vec<Field>,
        names: &mut BTreeSet<&'a str>,
        depth: usize,
    ) -> Result<(), String> {
        if depth > MAX_DEPTH {
            return Err(format!("{name} is nested too deeply"));
        }
        let definitions = self.definitions;
        if let Some(base) = &own.base {
            let base = self.look_up(name, base)?;
            match definitions.get(&base) {
                Some(Definition::Struct(structure)) => self.members(&base, structure, fields, names, depth + 1)?,
                Some(Definition::Unread(why)) => return Err(why.clone()),
                _ => return Err(format!("{base}, which {name} inherits from, is not a struct")),
            }
        }
        for (member, kind) in &own.members {
            if !names.insert(member) {
                return Err(format!("{name} has two members `{member}`"));
            }
            let (kind, count) = self.kind(name, kind, depth).map_err(|why| match why.starts_with("a ") {
                true => format!("`{member}` of {name} is {why}"),
                false => why,
            })?;
            fields.push(Field::new(member, kind, count));
        }
        Ok(())
    }

    fn kind(&mut self, scope: &str, kind: &Type, depth: usize) -> Result<(Kind, Count), String> {
        if depth > MAX_DEPTH {
            return Err(format!("types of {scope} are nested too deeply"));
        }
        Ok(match kind {
            Type::Number(number) => (Kind::Number(*number), Count::One),
            Type::Text => (Kind::Text, Count::One),
            Type::WideText => (Kind::WideText, Count::One),
            Type::Unread(why) => return Err(why.clone()),
            Type::Sequence(element) => (self.element(scope, element, depth)?, Count::Sequence),
            Type::Array(element, dimensions) => {
                let sizes = dimensions.iter().map(|dimension| self.size(scope, dimension));
                let sizes: Vec<u32> = sizes.collect::<Result<_, _>>()?;
                let size = sizes.iter().try_fold(1_u32, |size, n| size.checked_mul(*n));
                let size = size.ok_or_else(|| format!("{scope} has an array of absurd size"))?;
                (self.element(scope, element, depth)?, Count::Array(size))
            }
            Type::Named(name) => {
                let name = self.look_up(scope, name)?;
                let definitions = self.definitions;
                match definitions.get(&name) {
                    Some(Definition::Alias(alias)) => self.kind(&name, alias, depth + 1)?,
                    Some(Definition::Enum(number)) => (Kind::Number(*number), Count::One),
                    _ => (Kind::Message(self.message(&name, depth + 1)?), Count::One),
                }
            }
        })
    }

    /// Element type of a list. Lists of lists and of enumerations become lists of messages with one field: the bytes
    /// are the same, and in XCDR2 both have their size in front (DDS-XTypes 1.3, 7.4.3.5, rules 12 and 14).
    fn element(&mut self, scope: &str, element: &Type, depth: usize) -> Result<Kind, String> {
        let enumeration = self.is_enumeration(scope, element);
        match self.kind(scope, element, depth + 1)? {
            (kind, Count::One) if !enumeration => Ok(kind),
            (kind, count) => {
                let field = Field::new("", kind, count);
                let name = format!("{scope}[]");
                let id = self.add(Message { name, fields: vec![field], evolution: Evolution::Final })?;
                Ok(Kind::Message(id))
            }
        }
    }

    fn is_enumeration(&self, scope: &str, kind: &Type) -> bool {
        let Type::Named(name) = kind else { return false };
        let Ok(name) = self.look_up(scope, name) else { return false };
        matches!(self.definitions.get(&name), Some(Definition::Enum(_)))
    }

    fn size(&self, scope: &str, dimension: &str) -> Result<u32, String> {
        if let Ok(size) = dimension.parse() {
            return Ok(size);
        }
        match self.look_up(scope, dimension).ok().and_then(|name| self.definitions.get(&name)) {
            Some(Definition::Constant(Some(size))) => Ok(*size),
            _ => Err(format!("the size `{dimension}` of an array in {scope} is not a number or a constant")),
        }
    }

    /// Scoped name of the definition of `name` inside `scope`, the innermost first.
    fn look_up(&self, scope: &str, name: &str) -> Result<String, String> {
        if let Some(absolute) = name.strip_prefix("::") {
            return Ok(absolute.to_owned());
        }
        let mut scope = Some(scope);
        while let Some(inside) = scope {
            let candidate = format!("{inside}::{name}");
            if self.definitions.contains_key(&candidate) {
                return Ok(candidate);
            }
            scope = inside.rsplit_once("::").map(|(outer, _)| outer);
        }
        match self.definitions.contains_key(name) {
            true => Ok(name.to_owned()),
            false => Err(format!("{name} is not defined")),
        }
    }

    fn add(&mut self, message: Message) -> Result<usize, String> {
        if self.messages.len() >= MAX_MESSAGES {
            return Err(format!("needs more than {MAX_MESSAGES} types"));
        }
        self.messages.push(message);
        Ok(self.messages.len() - 1)
    }
}

/// Name as `package/Type`, without the parts that ROS and its middleware add: `sensor_msgs::msg::dds_::Imu_`.
fn plain(name: &str) -> String {
    match name.split("::").collect::<Vec<_>>()[..] {
        [package, "msg", "dds_", kind] => format!("{package}/{}", kind.trim_end_matches('_')),
        [package, "msg", kind] => format!("{package}/{kind}"),
        _ => name.replace("::", "/"),
    }
}
