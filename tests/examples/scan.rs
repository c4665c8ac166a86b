//! What is whole in a recording, by the scan alone: how many messages each topic has, and what is damaged.
//!
//! `cargo run --example scan -- testdata/demo.mcap`
#![allow(clippy::print_stdout)]

use std::error::Error;
use std::fs::File;
use std::os::unix::fs::FileExt as _;

use stillpoint::printable;
use stillpoint::record::{Event, Scan};

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args_os().nth(1).ok_or("which recording?")?;
    let file = File::open(path)?;
    // The scan does no reading itself: it says which bytes it needs, and what it finds in them.
    let mut scan = Scan::finished(file.metadata()?.len());
    loop {
        match scan.next_event()? {
            Event::Read { offset, length } => {
                file.read_exact_at(scan.insert(length), offset)?;
                scan.notify_read(length);
            }
            Event::Damage(damage) => println!("damaged {damage}"),
            Event::End => break,
            _ => {}
        }
    }
    let inventory = scan.into_inventory();
    for channel in inventory.channels().values() {
        println!("{} messages on {}", inventory.messages(channel.id), printable(&channel.topic));
    }
    Ok(())
}
