//! Generates the variables of all models.

fn main() {
    for model in ["decay", "van_der_pol", "robertson", "hires", "bouncing_ball", "stairs", "undeclared"] {
        fmu_export_build::generate(format!("{model}.json"));
    }
}
