//! The end of a recording, or of a trial of cameras, as it is asked for from outside.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use raven::{Error, Result};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::{Handle, Signals};
use signal_hook::low_level;

/// Whether Ctrl-C, a hang-up or a request to terminate has asked for the end; the second one ends the program at once.
///
/// One thread takes the signals in turn: of two that come together, handlers on two threads would each take theirs for the first.
pub struct Stop {
    asked: Arc<AtomicBool>,
    signals: Handle,
}

impl Stop {
    /// # Errors
    /// If the system refuses to have signals caught.
    pub fn on_signals() -> Result<Self> {
        let mut signals = Signals::new([SIGINT, SIGTERM, SIGHUP]).map_err(|e| Error::Data(format!("Ctrl-C cannot be caught: {e}.")))?;
        let stop = Self { asked: Arc::default(), signals: signals.handle() };
        let asked = Arc::clone(&stop.asked);
        thread::spawn(move || {
            for _ in signals.forever() {
                if asked.swap(true, Ordering::Relaxed) {
                    low_level::exit(130);
                }
            }
        });
        Ok(stop)
    }

    pub fn asked(&self) -> bool {
        self.asked.load(Ordering::Relaxed)
    }
}

impl Drop for Stop {
    fn drop(&mut self) {
        self.signals.close();
    }
}
