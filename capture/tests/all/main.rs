//! Tests of the program: one binary, so that those that wait for a robot wait together and all is linked once. Those that fill a disk, kill a
//! recording or need a machine of their own have their own binaries.

mod cli;
mod import;
#[path = "../lab/mod.rs"]
mod lab;
mod readers;
mod record;
mod robot;
mod rosmaster;
mod stopped;
