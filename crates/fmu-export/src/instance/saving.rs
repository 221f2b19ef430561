//! Saving and restoring an instance's memory (FMI 2.0.5, section 2.1.8).

use core::mem;

use fmu_solve::Error;
use fmu_terms::InstanceType;

use super::Instance;
use super::memory::Memory;
use crate::allocation::check_memory;
use crate::instance::serialized_state;
use crate::kinds::Model;

impl<M: Model> Instance<M> {
    /// A copy of everything that affects later calls.
    pub(crate) fn save(&mut self) -> Result<Memory<M>, Error> {
        self.check_partitions()?;
        if Self::DESCRIPTION.capabilities.get_and_set_state {
            check_memory(size_of::<Memory<M>>())?;
            self.may_roll_back = true;
            Ok(self.memory.clone())
        } else {
            Err(Error::new("this FMU cannot get and set its state (canGetAndSetFMUstate is false)"))
        }
    }

    /// Rejects calls that affect all model partitions while one is in Clock Update Mode (FMI 3.0.2, section 5.2.1).
    fn check_partitions(&self) -> Result<(), Error> {
        if self.clock_updates == 0 {
            Ok(())
        } else {
            Err(Error::new("must not be called while a model partition runs"))
        }
    }

    /// Continues from a saved memory.
    pub(crate) fn restore(&mut self, memory: &Memory<M>) -> Result<(), Error> {
        self.check_partitions()?;
        if memory.instance_type != self.memory.instance_type {
            return Err(Error::new(format!(
                "the state is one of {}, this instance is for {}",
                memory.instance_type, self.memory.instance_type
            )));
        }
        let mut model = mem::replace(&mut self.memory, memory.clone()).model;
        // Keeps what a model allocates for its steps, which a saved state lacks.
        model.clone_from(&memory.model);
        self.memory.model = model;
        self.logger.begin_again();
        Ok(())
    }

    /// A saved memory as bytes.
    pub(crate) fn serialize(memory: &Memory<M>) -> Result<Vec<u8>, Error> {
        Self::check_serializes()?;
        Self::to_bytes(memory)
    }

    /// A saved memory as bytes, whatever the FMU offers.
    pub(crate) fn to_bytes(memory: &Memory<M>) -> Result<Vec<u8>, Error> {
        let mut memory = memory.clone();
        memory.rewind();
        serialized_state::to_bytes(Self::DESCRIPTION, memory.instance_type, &mut memory)
    }

    /// The memory from bytes saved by this FMU, of an instance of any type.
    #[cfg(target_family = "wasm")]
    pub(crate) fn from_bytes(bytes: &[u8]) -> Result<Memory<M>, Error> {
        let [first, others @ ..] = InstanceType::ALL.map(|instance_type| Self::read(instance_type, bytes));
        others.into_iter().fold(first, Result::or)
    }

    /// The memory from bytes saved by this FMU, in any process.
    pub(crate) fn deserialize(&self, bytes: &[u8]) -> Result<Memory<M>, Error> {
        Self::check_serializes()?;
        Self::read(self.memory.instance_type, bytes)
    }

    fn read(instance_type: InstanceType, bytes: &[u8]) -> Result<Memory<M>, Error> {
        let mut memory = Memory::<M>::new(instance_type);
        serialized_state::from_bytes(Self::DESCRIPTION, instance_type, bytes, &mut memory)?;
        memory.model.restored(&memory.variables);
        Ok(memory)
    }

    fn check_serializes() -> Result<(), Error> {
        if Self::DESCRIPTION.capabilities.serialize_state {
            Ok(())
        } else {
            Err(Error::new("this FMU cannot serialize its state (canSerializeFMUstate is false)"))
        }
    }
}
