//! Generates the descriptions of this repository's plant and controller: they are the interface.

fn main() {
    fmu_export_build::generate("../../modelDescription/plant.json");
    fmu_export_build::generate("../../modelDescription/controller.json");
}
