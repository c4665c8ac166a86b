//! Numbers that elements of a list leave out, added to a copy of the message. The lengths around them grow.

use super::plan::{MAX_PARTS, ProtobufPlan, Take};
use super::wire;

/// A number that an element of a list leaves out, since it is zero.
pub(in crate::imu::decode) struct Missing {
    pub(in crate::imu::decode) slot: usize,
    /// Index among the elements that the slot is wanted of.
    pub(in crate::imu::decode) element: usize,
    pub(in crate::imu::decode) bytes: Vec<u8>,
}

impl ProtobufPlan {
    /// Copy of a message with these numbers added; `None` if it cannot be read.
    pub(in crate::imu::decode) fn grown(&self, data: &[u8], missing: &[Missing]) -> Option<Vec<u8>> {
        self.grow(data, missing, &mut [0; MAX_PARTS])
    }

    /// The same, with the number of elements of each list so far: of a message in parts, the lists are joined.
    fn grow(&self, data: &[u8], missing: &[Missing], counts: &mut [u32; MAX_PARTS]) -> Option<Vec<u8>> {
        let (mut out, mut rest) = (Vec::with_capacity(data.len() + 16), data);
        // Fields in a group are none of the message.
        let mut groups = 0_u32;
        while !rest.is_empty() {
            let field = rest;
            let tag = wire::take_varint(&mut rest)?;
            let head = field.get(..field.len() - rest.len())?;
            match tag & 7 {
                wire::VARINT => {
                    wire::take_varint(&mut rest)?;
                }
                wire::I64 => {
                    rest.split_off(..8)?;
                }
                wire::I32 => {
                    rest.split_off(..4)?;
                }
                wire::GROUP => groups += 1,
                wire::END_GROUP => groups = groups.checked_sub(1)?,
                wire::LEN => {
                    let len = usize::try_from(wire::take_varint(&mut rest)?).ok()?;
                    let body = rest.split_off(..len)?;
                    let planned = self.fields.iter().find(|planned| u64::from(planned.number) == tag >> 3);
                    let grown = planned.filter(|_| groups == 0).map(|planned| planned.take.grow(body, missing, counts));
                    if let Some(grown) = grown.flatten().filter(|grown| grown.len() > body.len()) {
                        out.extend_from_slice(head);
                        wire::varint(&mut out, grown.len() as u64);
                        out.extend(grown);
                        continue;
                    }
                }
                _ => return None,
            }
            out.extend_from_slice(field.get(..field.len() - rest.len())?);
        }
        Some(out)
    }
}

impl Take {
    /// Copy of the body of a field with what is missing in it; `None` if nothing is.
    fn grow(&self, body: &[u8], missing: &[Missing], counts: &mut [u32; MAX_PARTS]) -> Option<Vec<u8>> {
        let mut next = |list: usize| {
            let count = counts.get_mut(list)?;
            *count += 1;
            Some(*count - 1)
        };
        match self {
            Self::Message(inner) => inner.grow(body, missing, counts),
            Self::Messages { list, every: Some(every), .. } => {
                let element = next(*list)?;
                let mut out = body.to_vec();
                for Missing { slot, element: own, bytes } in missing {
                    let stride = every.slots.iter().find(|(wanted, _)| wanted == slot).map(|(_, stride)| *stride);
                    if stride.is_some_and(|stride| stride.place(*own) == Some(element)) {
                        let (way, _) = every.plan.way(*slot).filter(|(way, _)| !way.is_empty())?;
                        out.extend(wire::alone(&way, bytes));
                    }
                }
                Some(out)
            }
            Self::Messages { list, elements, .. } => {
                let element = next(*list)?;
                let (_, inner) = elements.iter().find(|(wanted, _)| *wanted == element)?;
                inner.grow(body, missing, counts)
            }
            Self::Number { .. } | Self::Numbers { .. } | Self::Text => None,
        }
    }
}
