//! Generates the typed interface and the modelDescription.xml of both models from their declarations.

fn main() {
    fmi2_export::build::generate("modelDescription/plant.json");
    fmi2_export::build::generate("modelDescription/controller.json");
}
