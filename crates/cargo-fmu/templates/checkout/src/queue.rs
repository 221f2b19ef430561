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
    /// A queue of nobody, with arrivals and served customers per hour.
    pub fn new(seed: i32, rates: [f64; 2]) -> Self {
        let mut queue = Self::default();
        [queue.arrivals_per_hour, queue.served_per_hour] = rates;
        queue.random = u64::from(seed.unsigned_abs());
        queue.departure = f64::INFINITY;
        queue.arrival = queue.after(0.0, queue.arrivals_per_hour);
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
        // Knuth's MMIX generator (The Art of Computer Programming, volume 2, section 3.3.4): its upper half.
        self.random = self
            .random
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        let upper = u32::try_from(self.random >> 32).unwrap_or(u32::MAX);
        let share = (f64::from(upper) + 0.5) / 4_294_967_296.0;
        now - share.ln() / rate
    }
}
