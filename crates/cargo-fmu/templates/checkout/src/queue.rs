//! A queue with random arrivals and service, simulated from event to event, in hours.

use fmu_export::Persistent;

/// Customers, the first of whom is being served.
#[derive(Clone, Debug, Default, Persistent)]
pub struct Queue {
    pub arrivals_per_hour: f64,
    served_per_hour: f64,
    waiting: i32,
    arrival: f64,
    departure: f64,
    random: u64,
}

impl Queue {
    pub fn new(seed: i32, arrivals_per_hour: f64, served_per_hour: f64) -> Self {
        let random = u64::from(seed.unsigned_abs());
        let mut queue = Self { arrivals_per_hour, served_per_hour, random, ..Self::default() };
        queue.departure = f64::INFINITY;
        queue.arrival = queue.after(0.0, arrivals_per_hour);
        queue
    }

    pub fn waiting(&self) -> i32 {
        self.waiting
    }

    pub fn run_until(&mut self, hours: f64) {
        while self.arrival.min(self.departure) <= hours {
            let now = self.arrival.min(self.departure);
            if self.arrival <= self.departure {
                self.waiting += 1;
                self.arrival = self.after(now, self.arrivals_per_hour);
            } else {
                self.waiting -= 1;
                self.departure = f64::INFINITY;
            }
            if self.waiting > 0 && self.departure.is_infinite() {
                self.departure = self.after(now, self.served_per_hour);
            }
        }
    }

    /// The time of the next event of a rate: exponentially distributed after now.
    fn after(&mut self, now: f64, rate: f64) -> f64 {
        // Knuth's MMIX generator (The Art of Computer Programming, volume 2, section 3.3.4), of which the upper half is used.
        self.random =
            self.random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let share = ((self.random >> 32) as f64 + 0.5) / 4_294_967_296.0;
        now - share.ln() / rate
    }
}
