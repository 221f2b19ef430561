/* The FMI 2.0 functions around the translated model. Only this file and the headers it includes are not translated.
   FMI2_FUNCTION_PREFIX prefixes the functions, to link several FMUs into one program. */

#ifdef FMI2_FUNCTION_PREFIX
#define FUNCTION_PREFIX FMI2_FUNCTION_PREFIX
#endif

/* Instantiation arguments other than texts. */
typedef struct {
  int type;
} Importer;

#include "model.h"
#ifdef Z_modelZ_fmi2GetDerivatives
#define HAS_STATES
#endif
#include "runtime.h"

#define GET_STATE Z_modelZ_fmi2GetFMUstate
#define SET_STATE Z_modelZ_fmi2SetFMUstate
#define FREE_STATE Z_modelZ_fmi2FreeFMUstate
#define STATE_SIZE Z_modelZ_fmi2SerializedFMUstateSize
#define SERIALIZE Z_modelZ_fmi2SerializeFMUstate
#define DESERIALIZE Z_modelZ_fmi2DeSerializeFMUstate
#include "states.h"

/* fmi2TypesPlatform.h and fmi2FunctionTypes.h. */
typedef void *Component;
typedef void *FmuState;
typedef int Integer;
typedef int Boolean;
typedef const char *String;
typedef unsigned int ValueReference;
typedef void (*CallbackLogger)(void *, String, int, String, String, ...);
typedef struct {
  CallbackLogger logger;
  void *(*allocateMemory)(size_t, size_t);
  void (*freeMemory)(void *);
  void (*stepFinished)(void *, int);
  void *componentEnvironment;
} CallbackFunctions;
typedef struct {
  Boolean newDiscreteStatesNeeded, terminateSimulation, nominalsOfContinuousStatesChanged;
  Boolean valuesOfContinuousStatesChanged, nextEventTimeDefined;
  double nextEventTime;
} EventInfo;

static void log_message(const Instance *instance, const Message *message) {
  ((CallbackLogger)instance->logger)(instance->environment, instance->name ? instance->name : "", message->status,
                                     message->category, "%s", message->text);
}

/* The size of fmi2CallbackFunctions in the module: only the logger of its five pointers is not null. */
#define CALLBACKS 20

static u32 make_instance(Instance *instance) {
  const Passed passed = pass(instance, CALLBACKS);
  u32 handle, i;
  for (i = 0; i < CALLBACKS; i += 4) {
    i32_store(&instance->module.w2c_memory, passed.bytes + (u64)i, i == 0 && instance->logger);
  }
  handle = Z_modelZ_fmi2Instantiate(&instance->module, passed.name, (u32)instance->importer.type, passed.token,
                                    passed.resources, passed.bytes, 0, (u32)instance->is_logging);
  free_passed(instance, &passed);
  return handle;
}

EXPORT const char *FMI(fmi2GetTypesPlatform)(void) {
  return "default";
}

EXPORT const char *FMI(fmi2GetVersion)(void) {
  return "2.0";
}

EXPORT Component FMI(fmi2Instantiate)(String instanceName, int fmuType, String fmuGUID, String fmuResourceLocation,
                                       const CallbackFunctions *functions, Boolean visible, Boolean loggingOn) {
  CallbackFunctions callbacks;
  Instance *instance;
  (void)visible;
  if (!functions) return NULL;
  memcpy(&callbacks, functions, sizeof callbacks);
  instance = new_instance(instanceName, fmuGUID, fmuResourceLocation);
  if (!instance) {
    if (callbacks.logger) {
      callbacks.logger(callbacks.componentEnvironment, instanceName ? instanceName : "", STATUS_ERROR, "logStatusError",
                       "%s", "fmi2Instantiate: out of memory for an instance");
    }
    return NULL;
  }
  instance->environment = callbacks.componentEnvironment;
  instance->logger = (void (*)(void))callbacks.logger;
  instance->is_logging = loggingOn;
  instance->importer.type = fmuType;
  return instantiate(instance, "fmi2Instantiate");
}

EXPORT void FMI(fmi2FreeInstance)(Component instance) {
  free_instance(instance);
}

#define GET(name, type)                                                                           \
  FUNCTION(name, (Component instance, const ValueReference vr[], size_t nvr, type value[]), INTEGERS, \
           ARRAY(vr, nvr), SIZE(nvr), RESULT(value, nvr))
#define SET(name, type)                                                                                 \
  FUNCTION(name, (Component instance, const ValueReference vr[], size_t nvr, const type value[]), INTEGERS, \
           ARRAY(vr, nvr), SIZE(nvr), ARRAY(value, nvr))
#define STATUS(name, type) \
  FUNCTION(name, (Component instance, int kind, type *value), INTEGERS, INTEGER(kind), RESULT(value, 1))

FUNCTION(fmi2SetDebugLogging, (Component instance, Boolean loggingOn, size_t nCategories, const String categories[]),
         INTEGERS, INTEGER(loggingOn), SIZE(nCategories), TEXTS(categories, nCategories))
FUNCTION(fmi2SetupExperiment,
         (Component instance, Boolean toleranceDefined, double tolerance, double startTime, Boolean stopTimeDefined,
          double stopTime),
         IDDID, INTEGER(toleranceDefined), REAL(tolerance), REAL(startTime), INTEGER(stopTimeDefined), REAL(stopTime))
TRANSITION(fmi2EnterInitializationMode)
TRANSITION(fmi2ExitInitializationMode)
TRANSITION(fmi2Terminate)
TRANSITION(fmi2Reset)
GET(fmi2GetReal, double)
GET(fmi2GetInteger, Integer)
GET(fmi2GetBoolean, Boolean)
FUNCTION(fmi2GetString, (Component instance, const ValueReference vr[], size_t nvr, String value[]), INTEGERS,
         ARRAY(vr, nvr), SIZE(nvr), TEXTS_RESULT(value, nvr))
SET(fmi2SetReal, double)
SET(fmi2SetInteger, Integer)
SET(fmi2SetBoolean, Boolean)
FUNCTION(fmi2SetString, (Component instance, const ValueReference vr[], size_t nvr, const String value[]), INTEGERS,
         ARRAY(vr, nvr), SIZE(nvr), TEXTS(value, nvr))
FUNCTION(fmi2GetDirectionalDerivative,
         (Component instance, const ValueReference vUnknown_ref[], size_t nUnknown, const ValueReference vKnown_ref[],
          size_t nKnown, const double dvKnown[], double dvUnknown[]),
         INTEGERS, ARRAY(vUnknown_ref, nUnknown), SIZE(nUnknown), ARRAY(vKnown_ref, nKnown), SIZE(nKnown),
         ARRAY(dvKnown, nKnown), RESULT(dvUnknown, nUnknown))

STATE_FUNCTION(fmi2GetFMUstate, (Component instance, FmuState *state), get_state, NULL, state, NULL, 0)
STATE_FUNCTION(fmi2SetFMUstate, (Component instance, FmuState state), set_state, state, NULL, NULL, 0)
STATE_FUNCTION(fmi2FreeFMUstate, (Component instance, FmuState *state), free_state, NULL, state, NULL, 0)
STATE_FUNCTION(fmi2SerializedFMUstateSize, (Component instance, FmuState state, size_t *size),
               get_state_size, state, NULL, size, 0)
STATE_FUNCTION(fmi2SerializeFMUstate, (Component instance, FmuState state, char serializedState[], size_t size),
               serialize, state, NULL, serializedState, size)
STATE_FUNCTION(fmi2DeSerializeFMUstate, (Component instance, const char serializedState[], size_t size, FmuState *state),
               deserialize, NULL, state, serializedState, size)

#ifdef Z_modelZ_fmi2DoStep
FUNCTION(fmi2SetRealInputDerivatives,
         (Component instance, const ValueReference vr[], size_t nvr, const Integer order[], const double value[]),
         INTEGERS, ARRAY(vr, nvr), SIZE(nvr), ARRAY(order, nvr), ARRAY(value, nvr))
FUNCTION(fmi2GetRealOutputDerivatives,
         (Component instance, const ValueReference vr[], size_t nvr, const Integer order[], double value[]), INTEGERS,
         ARRAY(vr, nvr), SIZE(nvr), ARRAY(order, nvr), RESULT(value, nvr))
FUNCTION(fmi2DoStep,
         (Component instance, double currentCommunicationPoint, double communicationStepSize,
          Boolean noSetFMUStatePriorToCurrentPoint),
         DDI, REAL(currentCommunicationPoint), REAL(communicationStepSize), INTEGER(noSetFMUStatePriorToCurrentPoint))
TRANSITION(fmi2CancelStep)
STATUS(fmi2GetStatus, int)
STATUS(fmi2GetRealStatus, double)
STATUS(fmi2GetIntegerStatus, Integer)
STATUS(fmi2GetBooleanStatus, Boolean)
FUNCTION(fmi2GetStringStatus, (Component instance, int kind, String *value), INTEGERS, INTEGER(kind),
         TEXTS_RESULT(value, 1))
#endif

#ifdef HAS_STATES
TRANSITION(fmi2EnterEventMode)
TRANSITION(fmi2EnterContinuousTimeMode)
FUNCTION(fmi2CompletedIntegratorStep,
         (Component instance, Boolean noSetFMUStatePriorToCurrentPoint, Boolean *enterEventMode,
          Boolean *terminateSimulation),
         INTEGERS, INTEGER(noSetFMUStatePriorToCurrentPoint), RESULT(enterEventMode, 1), RESULT(terminateSimulation, 1))
FUNCTION(fmi2SetTime, (Component instance, double time), D, REAL(time))
VECTOR(fmi2SetContinuousStates, const double, x, nx, MODEL_STATES, ARRAY)
VECTOR(fmi2GetDerivatives, double, derivatives, nx, MODEL_STATES, RESULT)
VECTOR(fmi2GetEventIndicators, double, eventIndicators, ni, MODEL_EVENT_INDICATORS, RESULT)
VECTOR(fmi2GetContinuousStates, double, x, nx, MODEL_STATES, RESULT)
VECTOR(fmi2GetNominalsOfContinuousStates, double, x_nominal, nx, MODEL_STATES, RESULT)

EXPORT int FMI(fmi2NewDiscreteStates)(Component instance, EventInfo *info) {
  /* As in the module: the double is at the next multiple of 8. */
  u8 bytes[32];
  Argument argument = RESULT(bytes, info ? sizeof bytes : 0);
  const int status = call(instance, "fmi2NewDiscreteStates", (wasm_rt_function_ptr_t)Z_modelZ_fmi2NewDiscreteStates,
                          INTEGERS, &argument, 1);
  if (status <= STATUS_WARNING) {
    EventInfo found;
    s32 flags[5];
    copy_numbers(flags, bytes, 5, sizeof *flags);
    copy_numbers(&found.nextEventTime, bytes + 24, 1, sizeof(double));
    found.newDiscreteStatesNeeded = flags[0];
    found.terminateSimulation = flags[1];
    found.nominalsOfContinuousStatesChanged = flags[2];
    found.valuesOfContinuousStatesChanged = flags[3];
    found.nextEventTimeDefined = flags[4];
    memcpy(info, &found, sizeof found);
  }
  return status;
}
#endif
