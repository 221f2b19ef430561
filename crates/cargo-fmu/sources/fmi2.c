/* The functions of FMI 2.0 around the translated model. This file and the header of the same folder that it includes are
   all that was not translated. With FMI2_FUNCTION_PREFIX, the functions have it, for linking several FMUs to one program. */

#include "runtime.h"

#define GET_STATE Z_modelZ_fmi2GetFMUstate
#define SET_STATE Z_modelZ_fmi2SetFMUstate
#define FREE_STATE Z_modelZ_fmi2FreeFMUstate
#define STATE_SIZE Z_modelZ_fmi2SerializedFMUstateSize
#define SERIALIZE Z_modelZ_fmi2SerializeFMUstate
#define DESERIALIZE Z_modelZ_fmi2DeSerializeFMUstate
#include "states.h"

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#elif defined(__GNUC__)
#define EXPORT __attribute__((visibility("default")))
#else
#define EXPORT
#endif
#ifdef FMI2_FUNCTION_PREFIX
#define PASTE(prefix, name) prefix##name
#define EXPAND(prefix, name) PASTE(prefix, name)
#define FMI2(name) EXPAND(FMI2_FUNCTION_PREFIX, name)
#else
#define FMI2(name) name
#endif

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

static u32 put_text(Instance *instance, u32 *next, const char *text) {
  wasm_rt_memory_t *memory = &instance->module.w2c_memory;
  const u32 address = *next;
  if (!text) return 0;
  check_range(memory, address, strlen(text) + 1);
  strcpy((char *)memory->data + address, text);
  *next += (u32)strlen(text) + 1;
  return address;
}

static u32 make_instance(Instance *instance) {
  const size_t texts = (instance->name ? strlen(instance->name) : 0) + (instance->token ? strlen(instance->token) : 0) +
                       (instance->resources ? strlen(instance->resources) : 0);
  const u32 callbacks = allocate(instance, 20 + texts + 3);
  u32 next = callbacks + 20, name, token, resources, handle, i;
  for (i = 0; i < 20; i += 4) i32_store(&instance->module.w2c_memory, callbacks + (u64)i, i == 0 && instance->logger);
  name = put_text(instance, &next, instance->name);
  token = put_text(instance, &next, instance->token);
  resources = put_text(instance, &next, instance->resources);
  handle = Z_modelZ_fmi2Instantiate(&instance->module, name, (u32)instance->type, token, resources, callbacks, 0,
                                    (u32)instance->is_logging);
  Z_modelZ_fmu_free(&instance->module, callbacks, (u32)(20 + texts + 3));
  return handle;
}

EXPORT const char *FMI2(fmi2GetTypesPlatform)(void) {
  return "default";
}

EXPORT const char *FMI2(fmi2GetVersion)(void) {
  return "2.0";
}

EXPORT Component FMI2(fmi2Instantiate)(String instanceName, int fmuType, String fmuGUID, String fmuResourceLocation,
                                       const CallbackFunctions *functions, Boolean visible, Boolean loggingOn) {
  CallbackFunctions callbacks;
  Instance *instance = functions ? calloc(1, sizeof *instance) : NULL;
  (void)visible;
  if (!instance) return NULL;
  memcpy(&callbacks, functions, sizeof callbacks);
  instance->library = &library;
  instance->make = make_instance;
  instance->end_of_messages = &instance->messages;
  instance->log = log_message;
  instance->name = copy_of(instanceName);
  instance->token = copy_of(fmuGUID);
  instance->resources = copy_of(fmuResourceLocation);
  instance->environment = callbacks.componentEnvironment;
  instance->logger = (void (*)(void))callbacks.logger;
  instance->type = fmuType;
  instance->is_logging = loggingOn;
  if (make(instance, "fmi2Instantiate")) {
    deliver(instance);
    return instance;
  }
  deliver(instance);
  free_memory(instance);
  return NULL;
}

EXPORT void FMI2(fmi2FreeInstance)(Component component) {
  free_instance(component);
}

/* A function that the module has: its name and parameters, the types of its arguments, and these. */
#define FUNCTION(name, parameters, shape, ...)                                                 \
  EXPORT int FMI2(name) parameters {                                                           \
    Argument arguments[] = {__VA_ARGS__};                                                      \
    return call(component, #name, (wasm_rt_function_ptr_t)Z_modelZ_##name, shape, arguments,   \
                (int)(sizeof arguments / sizeof *arguments));                                  \
  }
#define TRANSITION(name)                                                                       \
  EXPORT int FMI2(name)(Component component) {                                                 \
    return call(component, #name, (wasm_rt_function_ptr_t)Z_modelZ_##name, INTEGERS, NULL, 0); \
  }
#define GET(name, type)                                                                           \
  FUNCTION(name, (Component component, const ValueReference vr[], size_t nvr, type value[]), INTEGERS, \
           ARRAY(vr, nvr), SIZE(nvr), RESULT(value, nvr))
#define SET(name, type)                                                                                 \
  FUNCTION(name, (Component component, const ValueReference vr[], size_t nvr, const type value[]), INTEGERS, \
           ARRAY(vr, nvr), SIZE(nvr), ARRAY(value, nvr))
#define STATUS(name, type) \
  FUNCTION(name, (Component component, int kind, type *value), INTEGERS, INTEGER(kind), RESULT(value, 1))
/* The module counts before it writes or reads. */
#define VECTOR(name, type, argument, count, elements, ARGUMENT)                             \
  EXPORT int FMI2(name)(Component component, type argument[], size_t count) {               \
    Argument arguments[] = {ARGUMENT(argument, count == elements ? count : 0), SIZE(count)}; \
    if (count > UINT32_MAX) return refuse_count(component, #name, #count, count, elements); \
    return call(component, #name, (wasm_rt_function_ptr_t)Z_modelZ_##name, INTEGERS, arguments, 2); \
  }

FUNCTION(fmi2SetDebugLogging, (Component component, Boolean loggingOn, size_t nCategories, const String categories[]),
         INTEGERS, INTEGER(loggingOn), SIZE(nCategories), TEXTS(categories, nCategories))
FUNCTION(fmi2SetupExperiment,
         (Component component, Boolean toleranceDefined, double tolerance, double startTime, Boolean stopTimeDefined,
          double stopTime),
         IDDID, INTEGER(toleranceDefined), REAL(tolerance), REAL(startTime), INTEGER(stopTimeDefined), REAL(stopTime))
TRANSITION(fmi2EnterInitializationMode)
TRANSITION(fmi2ExitInitializationMode)
TRANSITION(fmi2Terminate)
TRANSITION(fmi2Reset)
GET(fmi2GetReal, double)
GET(fmi2GetInteger, Integer)
GET(fmi2GetBoolean, Boolean)
FUNCTION(fmi2GetString, (Component component, const ValueReference vr[], size_t nvr, String value[]), INTEGERS,
         ARRAY(vr, nvr), SIZE(nvr), TEXTS_RESULT(value, nvr))
SET(fmi2SetReal, double)
SET(fmi2SetInteger, Integer)
SET(fmi2SetBoolean, Boolean)
FUNCTION(fmi2SetString, (Component component, const ValueReference vr[], size_t nvr, const String value[]), INTEGERS,
         ARRAY(vr, nvr), SIZE(nvr), TEXTS(value, nvr))
FUNCTION(fmi2GetDirectionalDerivative,
         (Component component, const ValueReference vUnknown_ref[], size_t nUnknown, const ValueReference vKnown_ref[],
          size_t nKnown, const double dvKnown[], double dvUnknown[]),
         INTEGERS, ARRAY(vUnknown_ref, nUnknown), SIZE(nUnknown), ARRAY(vKnown_ref, nKnown), SIZE(nKnown),
         ARRAY(dvKnown, nKnown), RESULT(dvUnknown, nUnknown))

EXPORT int FMI2(fmi2GetFMUstate)(Component component, FmuState *state) {
  return call_of_state(component, "fmi2GetFMUstate", get_state, NULL, state, NULL, 0);
}

EXPORT int FMI2(fmi2SetFMUstate)(Component component, FmuState state) {
  return call_of_state(component, "fmi2SetFMUstate", set_state, state, NULL, NULL, 0);
}

EXPORT int FMI2(fmi2FreeFMUstate)(Component component, FmuState *state) {
  return call_of_state(component, "fmi2FreeFMUstate", free_state, NULL, state, NULL, 0);
}

EXPORT int FMI2(fmi2SerializedFMUstateSize)(Component component, FmuState state, size_t *size) {
  return call_of_state(component, "fmi2SerializedFMUstateSize", get_state_size, state, NULL, size, 0);
}

EXPORT int FMI2(fmi2SerializeFMUstate)(Component component, FmuState state, char serializedState[], size_t size) {
  return call_of_state(component, "fmi2SerializeFMUstate", serialize, state, NULL, serializedState, size);
}

EXPORT int FMI2(fmi2DeSerializeFMUstate)(Component component, const char serializedState[], size_t size, FmuState *state) {
  return call_of_state(component, "fmi2DeSerializeFMUstate", deserialize, NULL, state, (void *)(uintptr_t)serializedState,
                       size);
}

#ifdef Z_modelZ_fmi2DoStep
FUNCTION(fmi2SetRealInputDerivatives,
         (Component component, const ValueReference vr[], size_t nvr, const Integer order[], const double value[]),
         INTEGERS, ARRAY(vr, nvr), SIZE(nvr), ARRAY(order, nvr), ARRAY(value, nvr))
FUNCTION(fmi2GetRealOutputDerivatives,
         (Component component, const ValueReference vr[], size_t nvr, const Integer order[], double value[]), INTEGERS,
         ARRAY(vr, nvr), SIZE(nvr), ARRAY(order, nvr), RESULT(value, nvr))
FUNCTION(fmi2DoStep,
         (Component component, double currentCommunicationPoint, double communicationStepSize,
          Boolean noSetFMUStatePriorToCurrentPoint),
         DDI, REAL(currentCommunicationPoint), REAL(communicationStepSize), INTEGER(noSetFMUStatePriorToCurrentPoint))
TRANSITION(fmi2CancelStep)
STATUS(fmi2GetStatus, int)
STATUS(fmi2GetRealStatus, double)
STATUS(fmi2GetIntegerStatus, Integer)
STATUS(fmi2GetBooleanStatus, Boolean)
FUNCTION(fmi2GetStringStatus, (Component component, int kind, String *value), INTEGERS, INTEGER(kind),
         TEXTS_RESULT(value, 1))
#endif

#ifdef Z_modelZ_fmi2GetDerivatives
/* A count that the module cannot be given is refused as it would do. */
static int refuse_count(void *handle, const char *name, const char *argument, size_t count, unsigned int elements) {
  Instance *instance = instance_of(handle);
  char text[100];
  if (!instance) return STATUS_ERROR;
  snprintf(text, sizeof text, "%s is %llu; this FMU has %u", argument, (unsigned long long)count, elements);
  add_error(instance, name, text, "", "");
  deliver(instance);
  return STATUS_ERROR;
}

TRANSITION(fmi2EnterEventMode)
TRANSITION(fmi2EnterContinuousTimeMode)
FUNCTION(fmi2CompletedIntegratorStep,
         (Component component, Boolean noSetFMUStatePriorToCurrentPoint, Boolean *enterEventMode,
          Boolean *terminateSimulation),
         INTEGERS, INTEGER(noSetFMUStatePriorToCurrentPoint), RESULT(enterEventMode, 1), RESULT(terminateSimulation, 1))
FUNCTION(fmi2SetTime, (Component component, double time), D, REAL(time))
VECTOR(fmi2SetContinuousStates, const double, x, nx, MODEL_STATES, ARRAY)
VECTOR(fmi2GetDerivatives, double, derivatives, nx, MODEL_STATES, RESULT)
VECTOR(fmi2GetEventIndicators, double, eventIndicators, ni, MODEL_EVENT_INDICATORS, RESULT)
VECTOR(fmi2GetContinuousStates, double, x, nx, MODEL_STATES, RESULT)
VECTOR(fmi2GetNominalsOfContinuousStates, double, x_nominal, nx, MODEL_STATES, RESULT)

EXPORT int FMI2(fmi2NewDiscreteStates)(Component component, EventInfo *info) {
  /* As it is in the module: the double is at the next multiple of 8. */
  u8 bytes[32];
  Argument argument = RESULT(bytes, info ? sizeof bytes : 0);
  const int status = call(component, "fmi2NewDiscreteStates", (wasm_rt_function_ptr_t)Z_modelZ_fmi2NewDiscreteStates,
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
