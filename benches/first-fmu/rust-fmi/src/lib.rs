use fmi::fmi3::{Fmi3Error, Fmi3Res};
use fmi_export::FmuModel;
use fmi_export::fmi3::{CSDoStepResult, Context, DefaultLoggingCategory, UserModel};

#[derive(FmuModel, Default, Debug)]
#[model(co_simulation = true, user_model = false)]
struct Decay {
    #[variable(causality = Output, variability = Continuous, start = 1.0, initial = Exact)]
    x: f64,
    #[variable(causality = Local, variability = Continuous, derivative = x, initial = Calculated)]
    rate: f64,
    #[variable(causality = Parameter, variability = Fixed, start = 1.0, initial = Exact)]
    k: f64,
}

impl UserModel for Decay {
    type LoggingCategory = DefaultLoggingCategory;

    fn calculate_values(&mut self, _context: &dyn Context<Self>) -> Result<Fmi3Res, Fmi3Error> {
        self.rate = -self.k * self.x;
        Ok(Fmi3Res::OK)
    }

    fn do_step(
        &mut self,
        context: &mut dyn Context<Self>,
        time: f64,
        size: f64,
        _no_set_fmu_state_prior_to_current_point: bool,
    ) -> Result<CSDoStepResult, Fmi3Error> {
        let decay = (-size * self.k).exp();
        self.x *= decay;
        context.set_time(time + size);
        self.calculate_values(context)?;
        Ok(CSDoStepResult::completed(time + size))
    }
}

fmi_export::export_fmu!(Decay);
