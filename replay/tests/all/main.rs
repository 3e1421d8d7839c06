//! Tests of the program and of the chain of programs: one binary, so that the long ones share the processors and all is linked once.

mod added;
mod cli;
