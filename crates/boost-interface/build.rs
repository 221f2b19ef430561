//! Generates the descriptions of this repository's plant and controller: they are the interface.

fn main() {
    fmi2_export::build::generate("../../modelDescription/plant.json");
    fmi2_export::build::generate("../../modelDescription/controller.json");
}
