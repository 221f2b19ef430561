//! A model around a crate that simulates by itself: the README's, without its `fmu!`.

use fmu_export::{Context, Error, Persistent, Step, Stepped, Stepper};
use fmu_export_equations::checkout::{Inputs, Variables};
use fmu_terms::InstanceType;

use crate::importer::Importer;
use queue::Queue;

/// The crate: a queue with random arrivals and service, simulated from event to event, in hours.
mod queue {
    use rand_pcg::Pcg32;
    use rand_pcg::rand_core::Rng as _;
    use serde::{Deserialize, Serialize};

    #[derive(Clone, Debug, Deserialize, Serialize)]
    pub struct Queue {
        pub arrivals_per_hour: f64,
        served_per_hour: f64,
        waiting: i32,
        arrival: f64,
        departure: f64,
        random: Pcg32,
    }

    impl Queue {
        pub fn new(arrivals_per_hour: f64, served_per_hour: f64) -> Self {
            let random = Pcg32::new(1, 2);
            let mut queue = Self {
                arrivals_per_hour,
                served_per_hour,
                waiting: 0,
                arrival: 0.0,
                departure: f64::INFINITY,
                random,
            };
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

        fn after(&mut self, now: f64, rate: f64) -> f64 {
            now - ((f64::from(self.random.next_u32()) + 0.5) / 4_294_967_296.0).ln() / rate
        }
    }
}

const HOUR: f64 = 3600.0; // s

#[derive(Clone, Debug, Default, Persistent)]
struct Checkout {
    #[persistent(serde)]
    queue: Option<Queue>, // none before initialization
}

impl Stepper for Checkout {
    type Variables = Variables;

    fn initialize(&mut self, variables: &mut Variables, _: &mut Context<'_>) -> Result<(), Error> {
        let queue = Queue::new(variables.inputs.arrivals * HOUR, variables.parameters.service * HOUR);
        variables.outputs.waiting = f64::from(queue.waiting());
        self.queue = Some(queue);
        Ok(())
    }

    fn step(
        &mut self,
        variables: &mut Variables,
        step: &Step<'_, Inputs>,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        let queue = self.queue.as_mut().ok_or_else(|| Error::new("there is no queue"))?;
        queue.arrivals_per_hour = variables.inputs.arrivals * HOUR;
        queue.run_until((step.end() - context.experiment.start_time) / HOUR);
        variables.outputs.waiting = f64::from(queue.waiting());
        Ok(())
    }
}

/// The steps are those of the crate alone, whatever instance takes them.
#[test]
fn an_existing_simulation_is_stepped_and_saved() {
    let mut alone = Queue::new(0.02 * HOUR, 0.025 * HOUR);
    let expected: Vec<_> = (1..=60)
        .map(|minute| {
            alone.run_until(f64::from(minute) * 60.0 / HOUR);
            f64::from(alone.waiting())
        })
        .collect();
    assert!(expected.iter().any(|waiting| *waiting > 2.0));
    let mut importer = Importer::<Stepped<Checkout>>::new(InstanceType::CoSimulation);
    importer.initialize();
    let mut found = vec![];
    for minute in 0..60 {
        if minute == 30 {
            importer = importer.restored();
        }
        importer.step(60.0 * f64::from(minute), 60.0);
        found.push(importer.get(["waiting"])[0]);
    }
    assert_eq!(found, expected);
}

/// The checkout around a queue that could be cloned, but not written.
#[derive(Clone, Debug, Default, Persistent)]
struct Unwritten {
    #[persistent(skip)]
    checkout: Checkout,
}

impl Stepper for Unwritten {
    type Variables = Variables;

    fn initialize(&mut self, variables: &mut Variables, context: &mut Context<'_>) -> Result<(), Error> {
        self.checkout.initialize(variables, context)
    }

    fn step(
        &mut self,
        variables: &mut Variables,
        step: &Step<'_, Inputs>,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        self.checkout.step(variables, step, context)
    }
}

/// The queue of the second half hour is the same again, random numbers included.
#[test]
fn a_state_in_memory_has_the_skipped_fields() {
    let mut importer = Importer::<Stepped<Unwritten>>::new(InstanceType::CoSimulation);
    importer.initialize();
    importer.step(0.0, 1800.0);
    let [first, second] = importer.twice(|importer| {
        let minutes = (30..60).map(|minute| 60.0 * f64::from(minute));
        minutes
            .map(|time| {
                importer.step(time, 60.0);
                importer.get(["waiting"])[0]
            })
            .collect::<Vec<_>>()
    });
    assert!(first.iter().any(|waiting| *waiting > first[0]));
    assert_eq!(first, second);
}
