/* The FMI 3.0 functions around the translated model. Only this file and the headers it includes are not translated.
   FMI3_FUNCTION_PREFIX prefixes the functions, to link several FMUs into one program. */

#ifdef FMI3_FUNCTION_PREFIX
#define FUNCTION_PREFIX FMI3_FUNCTION_PREFIX
#endif

#include "model.h"

/* fmi3PlatformTypes.h and fmi3FunctionTypes.h. Booleans are bytes here, as importers may pass any. */
typedef void *FmuState;
typedef unsigned char Boolean;
typedef unsigned char Clock;
typedef const char *String;
typedef const unsigned char *Binary;
typedef u32 ValueReference;
typedef void (*LogMessage)(void *, int, String, String);
typedef void (*IntermediateUpdate)(void *, double, Boolean, Boolean, Boolean, Boolean, Boolean *, double *);
typedef void (*ClockUpdate)(void *);
typedef void (*Preemption)(void);

/* Instantiation arguments of Co-Simulation and Scheduled Execution other than texts. */
typedef struct {
  enum { CO_SIMULATION, MODEL_EXCHANGE, SCHEDULED_EXECUTION } type;
  Boolean event_mode_used, early_return_allowed;
  const ValueReference *required;
  size_t required_count;
  IntermediateUpdate intermediate_update;
  ClockUpdate clock_update;
} Importer;

#include "runtime.h"

#define GET_STATE Z_modelZ_fmi3GetFMUState
#define SET_STATE Z_modelZ_fmi3SetFMUState
#define FREE_STATE Z_modelZ_fmi3FreeFMUState
#define STATE_SIZE Z_modelZ_fmi3SerializedFMUStateSize
#define SERIALIZE Z_modelZ_fmi3SerializeFMUState
#define DESERIALIZE Z_modelZ_fmi3DeserializeFMUState
#include "states.h"

static void log_message(const Instance *instance, const Message *message) {
  ((LogMessage)instance->logger)(instance->environment, message->status, message->category, message->text);
}

/* ---- callbacks: the module calls those passed as non-null ---- */

#if defined(Z_fmuZ_intermediate_update) || defined(Z_fmuZ_clock_update)
/* After a callback: the call ends if another one trapped meanwhile, or the instance was freed. */
static void end_callback(Instance *instance) {
  if (instance->has_trapped || instance->is_freed) wasm_trap(&instance->module.w2c_memory, TRAP_CALLBACK);
}
#endif

#ifdef Z_fmuZ_intermediate_update
void Z_fmuZ_intermediate_update(struct Z_fmu_instance_t *host, u32 environment, f64 time, u32 set_requested, u32 get_allowed,
                                u32 step_finished, u32 can_return_early, u32 is_asked, u32 return_time) {
  Instance *instance = (Instance *)host;
  wasm_rt_memory_t *memory = &instance->module.w2c_memory;
  Boolean early_return_requested = 0;
  double early_return_time = f64_load(memory, return_time);
  (void)environment;
  deliver(instance);
  instance->importer.intermediate_update(instance->environment, time, (Boolean)set_requested, (Boolean)get_allowed,
                                         (Boolean)step_finished, (Boolean)can_return_early, &early_return_requested,
                                         &early_return_time);
  end_callback(instance);
  i32_store8(memory, is_asked, early_return_requested);
  f64_store(memory, return_time, early_return_time);
}
#endif

#ifdef Z_fmuZ_clock_update
/* Other calls may preempt this one if they return before it continues: they share the module's stack. */
void Z_fmuZ_clock_update(struct Z_fmu_instance_t *host, u32 environment) {
  Instance *instance = (Instance *)host;
  (void)environment;
  deliver(instance);
  if (instance->unlock) instance->unlock();
  instance->importer.clock_update(instance->environment);
  if (instance->lock) instance->lock();
  end_callback(instance);
}
#endif

/* The importer's locks surround argument copying, so the module need not lock its own functions. */
#ifdef Z_fmuZ_lock_preemption
void Z_fmuZ_lock_preemption(struct Z_fmu_instance_t *host) {
  (void)host;
}

void Z_fmuZ_unlock_preemption(struct Z_fmu_instance_t *host) {
  (void)host;
}
#endif

/* ---- instances ---- */

static u32 make_instance(Instance *instance) {
  const Importer *importer = &instance->importer;
  Z_model_instance_t *module = &instance->module;
  const size_t count = importer->required ? importer->required_count : 0;
  const Passed passed = pass(instance, count * sizeof *importer->required);
  const u32 is_logging = (u32)instance->is_logging, logger = instance->logger != NULL;
  u32 handle;
  copy_numbers(module->w2c_memory.data + passed.bytes, importer->required, count, sizeof *importer->required);
  if (importer->type == CO_SIMULATION) {
    handle = Z_modelZ_fmi3InstantiateCoSimulation(
        module, passed.name, passed.token, passed.resources, 0, is_logging, importer->event_mode_used,
        importer->early_return_allowed, count ? passed.bytes : 0, as_size(importer->required_count), 0, logger,
        importer->intermediate_update != NULL);
  } else if (importer->type == MODEL_EXCHANGE) {
    handle = Z_modelZ_fmi3InstantiateModelExchange(module, passed.name, passed.token, passed.resources, 0, is_logging, 0,
                                                   logger);
  } else {
    handle = Z_modelZ_fmi3InstantiateScheduledExecution(module, passed.name, passed.token, passed.resources, 0, is_logging,
                                                        0, logger, importer->clock_update != NULL, 0, 0);
  }
  free_passed(instance, &passed);
  return handle;
}

static Instance *new_importer(const Importer *importer, String name, String token, String resources, Boolean is_logging,
                              void *environment, LogMessage logger) {
  Instance *instance = new_instance(name, token, resources);
  if (!instance) {
    if (logger) logger(environment, STATUS_ERROR, "logStatusError", "out of memory for an instance");
    return NULL;
  }
  instance->importer = *importer;
  instance->is_logging = is_logging;
  instance->environment = environment;
  instance->logger = (void (*)(void))logger;
  return instance;
}

EXPORT const char *FMI(fmi3GetVersion)(void) {
  return "3.0";
}

EXPORT void *FMI(fmi3InstantiateCoSimulation)(
    String instanceName, String instantiationToken, String resourcePath, Boolean visible, Boolean loggingOn,
    Boolean eventModeUsed, Boolean earlyReturnAllowed, const ValueReference requiredIntermediateVariables[],
    size_t nRequiredIntermediateVariables, void *instanceEnvironment, LogMessage logMessage,
    IntermediateUpdate intermediateUpdate) {
  Importer importer = {CO_SIMULATION, 0, 0, NULL, 0, NULL, NULL};
  Instance *instance;
  (void)visible;
  importer.event_mode_used = eventModeUsed;
  importer.early_return_allowed = earlyReturnAllowed;
  importer.required_count = nRequiredIntermediateVariables;
  importer.intermediate_update = intermediateUpdate;
  instance = new_importer(&importer, instanceName, instantiationToken, resourcePath, loggingOn, instanceEnvironment,
                          logMessage);
  if (!instance) return NULL;
  if (requiredIntermediateVariables && nRequiredIntermediateVariables) {
    const size_t size = nRequiredIntermediateVariables * sizeof(ValueReference);
    instance->importer.required = instance->kept = malloc(size);
    if (instance->kept) memcpy(instance->kept, requiredIntermediateVariables, size);
  }
  return instantiate(instance, "fmi3InstantiateCoSimulation");
}

EXPORT void *FMI(fmi3InstantiateModelExchange)(String instanceName, String instantiationToken, String resourcePath,
                                               Boolean visible, Boolean loggingOn, void *instanceEnvironment,
                                               LogMessage logMessage) {
  const Importer importer = {MODEL_EXCHANGE, 0, 0, NULL, 0, NULL, NULL};
  Instance *instance = new_importer(&importer, instanceName, instantiationToken, resourcePath, loggingOn,
                                    instanceEnvironment, logMessage);
  (void)visible;
  return instance ? instantiate(instance, "fmi3InstantiateModelExchange") : NULL;
}

EXPORT void *FMI(fmi3InstantiateScheduledExecution)(String instanceName, String instantiationToken, String resourcePath,
                                                    Boolean visible, Boolean loggingOn, void *instanceEnvironment,
                                                    LogMessage logMessage, ClockUpdate clockUpdate,
                                                    Preemption lockPreemption, Preemption unlockPreemption) {
  Importer importer = {SCHEDULED_EXECUTION, 0, 0, NULL, 0, NULL, NULL};
  Instance *instance;
  (void)visible;
  importer.clock_update = clockUpdate;
  instance = new_importer(&importer, instanceName, instantiationToken, resourcePath, loggingOn, instanceEnvironment,
                          logMessage);
  if (!instance) return NULL;
  instance->lock = lockPreemption;
  instance->unlock = unlockPreemption;
  return instantiate(instance, "fmi3InstantiateScheduledExecution");
}

EXPORT void FMI(fmi3FreeInstance)(void *instance) {
  free_instance(instance);
}

/* ---- the other functions, in the order of fmi3FunctionTypes.h ---- */

#define REFERENCES const ValueReference valueReferences[], size_t nValueReferences
#define GET_AND_SET(type, element)                                                                               \
  FUNCTION(fmi3Get##type, (void *instance, REFERENCES, element values[], size_t nValues), INTEGERS,               \
           ARRAY(valueReferences, nValueReferences), SIZE(nValueReferences), RESULT(values, nValues), SIZE(nValues)) \
  FUNCTION(fmi3Set##type, (void *instance, REFERENCES, const element values[], size_t nValues), INTEGERS,         \
           ARRAY(valueReferences, nValueReferences), SIZE(nValueReferences), ARRAY(values, nValues), SIZE(nValues))
#define REFERENCES_WITH(first, second)                                                             \
  ARRAY(valueReferences, nValueReferences), SIZE(nValueReferences), first(second, nValueReferences)
#define OF_CLOCKS(name, type, values, ARGUMENT)                                                    \
  FUNCTION(name, (void *instance, REFERENCES, type values[]), INTEGERS, REFERENCES_WITH(ARGUMENT, values))
#define OF_FRACTIONS(name, type, ARGUMENT)                                                         \
  FUNCTION(name, (void *instance, REFERENCES, type counters[], type resolutions[]), INTEGERS,      \
           REFERENCES_WITH(ARGUMENT, counters), ARGUMENT(resolutions, nValueReferences))
#define DERIVATIVE(name)                                                                                             \
  FUNCTION(name,                                                                                                     \
           (void *instance, const ValueReference unknowns[], size_t nUnknowns, const ValueReference knowns[],         \
            size_t nKnowns, const double seed[], size_t nSeed, double sensitivity[], size_t nSensitivity),            \
           INTEGERS, ARRAY(unknowns, nUnknowns), SIZE(nUnknowns), ARRAY(knowns, nKnowns), SIZE(nKnowns),              \
           ARRAY(seed, nSeed), SIZE(nSeed), RESULT(sensitivity, nSensitivity), SIZE(nSensitivity))
#define GET_VECTOR(name, values, count) \
  FUNCTION(name, (void *instance, double values[], size_t count), INTEGERS, RESULT(values, count), SIZE(count))
#define COUNT(name) FUNCTION(name, (void *instance, size_t *count), INTEGERS, SIZES_RESULT(count, 1))

FUNCTION(fmi3SetDebugLogging, (void *instance, Boolean loggingOn, size_t nCategories, const String categories[]), INTEGERS,
         INTEGER(loggingOn), SIZE(nCategories), TEXTS(categories, nCategories))
FUNCTION(fmi3EnterInitializationMode,
         (void *instance, Boolean toleranceDefined, double tolerance, double startTime, Boolean stopTimeDefined,
          double stopTime),
         IDDID, INTEGER(toleranceDefined), REAL(tolerance), REAL(startTime), INTEGER(stopTimeDefined), REAL(stopTime))
TRANSITION(fmi3ExitInitializationMode)
TRANSITION(fmi3EnterEventMode)
TRANSITION(fmi3Terminate)
TRANSITION(fmi3Reset)
GET_AND_SET(Float32, f32)
GET_AND_SET(Float64, f64)
GET_AND_SET(Int8, s8)
GET_AND_SET(UInt8, u8)
GET_AND_SET(Int16, s16)
GET_AND_SET(UInt16, u16)
GET_AND_SET(Int32, s32)
GET_AND_SET(UInt32, u32)
GET_AND_SET(Int64, s64)
GET_AND_SET(UInt64, u64)
GET_AND_SET(Boolean, Boolean)
FUNCTION(fmi3GetString, (void *instance, REFERENCES, String values[], size_t nValues), INTEGERS,
         ARRAY(valueReferences, nValueReferences), SIZE(nValueReferences), TEXTS_RESULT(values, nValues), SIZE(nValues))
FUNCTION(fmi3SetString, (void *instance, REFERENCES, const String values[], size_t nValues), INTEGERS,
         ARRAY(valueReferences, nValueReferences), SIZE(nValueReferences), TEXTS(values, nValues), SIZE(nValues))
FUNCTION(fmi3GetBinary, (void *instance, REFERENCES, size_t valueSizes[], Binary values[], size_t nValues), INTEGERS,
         ARRAY(valueReferences, nValueReferences), SIZE(nValueReferences), SIZES_RESULT(valueSizes, nValues),
         BINARIES_RESULT(values, nValues), SIZE(nValues))
FUNCTION(fmi3SetBinary, (void *instance, REFERENCES, const size_t valueSizes[], const Binary values[], size_t nValues),
         INTEGERS, ARRAY(valueReferences, nValueReferences), SIZE(nValueReferences), SIZES(valueSizes, nValues),
         BINARIES(values, nValues), SIZE(nValues))
OF_CLOCKS(fmi3GetClock, Clock, values, RESULT)
OF_CLOCKS(fmi3SetClock, const Clock, values, ARRAY)
FUNCTION(fmi3GetNumberOfVariableDependencies, (void *instance, ValueReference valueReference, size_t *nDependencies),
         INTEGERS, INTEGER(valueReference), SIZES_RESULT(nDependencies, 1))
FUNCTION(fmi3GetVariableDependencies,
         (void *instance, ValueReference dependent, size_t elementIndicesOfDependent[], ValueReference independents[],
          size_t elementIndicesOfIndependents[], int dependencyKinds[], size_t nDependencies),
         INTEGERS, INTEGER(dependent), SIZES_RESULT(elementIndicesOfDependent, nDependencies),
         RESULT(independents, nDependencies), SIZES_RESULT(elementIndicesOfIndependents, nDependencies),
         RESULT(dependencyKinds, nDependencies), SIZE(nDependencies))

STATE_FUNCTION(fmi3GetFMUState, (void *instance, FmuState *state), get_state, NULL, state, NULL, 0)
STATE_FUNCTION(fmi3SetFMUState, (void *instance, FmuState state), set_state, state, NULL, NULL, 0)
STATE_FUNCTION(fmi3FreeFMUState, (void *instance, FmuState *state), free_state, NULL, state, NULL, 0)
STATE_FUNCTION(fmi3SerializedFMUStateSize, (void *instance, FmuState state, size_t *size),
               get_state_size, state, NULL, size, 0)
STATE_FUNCTION(fmi3SerializeFMUState, (void *instance, FmuState state, u8 serializedState[], size_t size),
               serialize, state, NULL, serializedState, size)
STATE_FUNCTION(fmi3DeserializeFMUState, (void *instance, const u8 serializedState[], size_t size, FmuState *state),
               deserialize, NULL, state, serializedState, size)

DERIVATIVE(fmi3GetDirectionalDerivative)
DERIVATIVE(fmi3GetAdjointDerivative)
TRANSITION(fmi3EnterConfigurationMode)
TRANSITION(fmi3ExitConfigurationMode)
FUNCTION(fmi3GetIntervalDecimal, (void *instance, REFERENCES, double intervals[], int qualifiers[]), INTEGERS,
         REFERENCES_WITH(RESULT, intervals), RESULT(qualifiers, nValueReferences))
FUNCTION(fmi3GetIntervalFraction, (void *instance, REFERENCES, u64 counters[], u64 resolutions[], int qualifiers[]), INTEGERS,
         REFERENCES_WITH(RESULT, counters), RESULT(resolutions, nValueReferences), RESULT(qualifiers, nValueReferences))
OF_CLOCKS(fmi3GetShiftDecimal, double, shifts, RESULT)
OF_FRACTIONS(fmi3GetShiftFraction, u64, RESULT)
OF_CLOCKS(fmi3SetIntervalDecimal, const double, intervals, ARRAY)
OF_FRACTIONS(fmi3SetIntervalFraction, const u64, ARRAY)
OF_CLOCKS(fmi3SetShiftDecimal, const double, shifts, ARRAY)
OF_FRACTIONS(fmi3SetShiftFraction, const u64, ARRAY)
TRANSITION(fmi3EvaluateDiscreteStates)
FUNCTION(fmi3UpdateDiscreteStates,
         (void *instance, Boolean *discreteStatesNeedUpdate, Boolean *terminateSimulation,
          Boolean *nominalsOfContinuousStatesChanged, Boolean *valuesOfContinuousStatesChanged, Boolean *nextEventTimeDefined,
          double *nextEventTime),
         INTEGERS, RESULT(discreteStatesNeedUpdate, 1), RESULT(terminateSimulation, 1),
         RESULT(nominalsOfContinuousStatesChanged, 1), RESULT(valuesOfContinuousStatesChanged, 1),
         RESULT(nextEventTimeDefined, 1), RESULT(nextEventTime, 1))

/* Model Exchange */
TRANSITION(fmi3EnterContinuousTimeMode)
FUNCTION(fmi3CompletedIntegratorStep,
         (void *instance, Boolean noSetFMUStatePriorToCurrentPoint, Boolean *enterEventMode, Boolean *terminateSimulation),
         INTEGERS, INTEGER(noSetFMUStatePriorToCurrentPoint), RESULT(enterEventMode, 1), RESULT(terminateSimulation, 1))
FUNCTION(fmi3SetTime, (void *instance, double time), D, REAL(time))
FUNCTION(fmi3SetContinuousStates, (void *instance, const double continuousStates[], size_t nContinuousStates), INTEGERS,
         ARRAY(continuousStates, nContinuousStates), SIZE(nContinuousStates))
GET_VECTOR(fmi3GetContinuousStateDerivatives, derivatives, nContinuousStates)
GET_VECTOR(fmi3GetEventIndicators, eventIndicators, nEventIndicators)
GET_VECTOR(fmi3GetContinuousStates, continuousStates, nContinuousStates)
GET_VECTOR(fmi3GetNominalsOfContinuousStates, nominals, nContinuousStates)
COUNT(fmi3GetNumberOfEventIndicators)
COUNT(fmi3GetNumberOfContinuousStates)

/* Co-Simulation */
TRANSITION(fmi3EnterStepMode)
FUNCTION(fmi3GetOutputDerivatives, (void *instance, REFERENCES, const s32 orders[], double values[], size_t nValues), INTEGERS,
         REFERENCES_WITH(ARRAY, orders), RESULT(values, nValues), SIZE(nValues))
FUNCTION(fmi3DoStep,
         (void *instance, double currentCommunicationPoint, double communicationStepSize,
          Boolean noSetFMUStatePriorToCurrentPoint, Boolean *eventHandlingNeeded, Boolean *terminateSimulation,
          Boolean *earlyReturn, double *lastSuccessfulTime),
         DDIIIII, REAL(currentCommunicationPoint), REAL(communicationStepSize), INTEGER(noSetFMUStatePriorToCurrentPoint),
         RESULT_ANYWAY(eventHandlingNeeded, 1), RESULT_ANYWAY(terminateSimulation, 1), RESULT_ANYWAY(earlyReturn, 1),
         RESULT_ANYWAY(lastSuccessfulTime, 1))

/* Scheduled Execution */
FUNCTION(fmi3ActivateModelPartition, (void *instance, ValueReference clockReference, double activationTime), ID,
         INTEGER(clockReference), REAL(activationTime))
