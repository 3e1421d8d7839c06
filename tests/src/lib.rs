//! End-to-end tests of raven-cal; see `tests/`.
