use fmi::fmi3::{Fmi3Error, Fmi3Res};
use fmi_export::FmuModel;
use fmi_export::fmi3::{CSDoStepResult, Context, DefaultLoggingCategory, UserModel};

#[derive(FmuModel, Default, Debug)]
#[model(co_simulation = true, user_model = false)]
struct Lag {
    #[variable(causality = Input, variability = Continuous, start = 1.0)]
    voltage: f64,
    #[variable(causality = Parameter, variability = Fixed, start = 0.5, initial = Exact)]
    time_constant: f64,
    #[variable(causality = Output, variability = Continuous, start = 0.0, initial = Exact)]
    lagged_voltage: f64,
    #[variable(causality = Local, variability = Continuous, derivative = lagged_voltage, initial = Calculated)]
    rate: f64,
}

impl UserModel for Lag {
    type LoggingCategory = DefaultLoggingCategory;

    fn calculate_values(&mut self, _context: &dyn Context<Self>) -> Result<Fmi3Res, Fmi3Error> {
        self.rate = (self.voltage - self.lagged_voltage) / self.time_constant;
        Ok(Fmi3Res::OK)
    }

    fn do_step(
        &mut self,
        context: &mut dyn Context<Self>,
        time: f64,
        size: f64,
        _no_set_fmu_state_prior_to_current_point: bool,
    ) -> Result<CSDoStepResult, Fmi3Error> {
        let decay = (-size / self.time_constant).exp();
        self.lagged_voltage = self.voltage + (self.lagged_voltage - self.voltage) * decay;
        context.set_time(time + size);
        self.calculate_values(context)?;
        Ok(CSDoStepResult::completed(time + size))
    }
}

fmi_export::export_fmu!(Lag);
