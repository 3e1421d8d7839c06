//! Tests of the program and of its methods: one binary, so that the long ones share the processors and all is linked once.

mod acceptance;
mod added;
mod cli;
mod damping;
mod excite;
mod export;
mod left;
mod recordings;
mod recursive;
mod simulated;
mod soft_cables;
mod systematic;
mod virtual_lab;
mod virtual_robot;
mod within_tolerances;
