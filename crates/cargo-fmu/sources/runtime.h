/* Shared by all FMI versions: instances, calls of their modules' functions, and saved states. */

#include "arguments.h"

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#elif defined(__GNUC__)
#define EXPORT __attribute__((visibility("default")))
#else
#define EXPORT
#endif
#ifdef FUNCTION_PREFIX
#define PASTE(prefix, name) prefix##name
#define EXPAND(prefix, name) PASTE(prefix, name)
#define FMI(name) EXPAND(FUNCTION_PREFIX, name)
#else
#define FMI(name) name
#endif

/* Why a call trapped. */
static const char *explain(const wasm_rt_memory_t *memory, int trap) {
  if (memory->is_exhausted) return "out of memory, limited by MODEL_PAGES in model.h";
  switch (trap) {
    case TRAP_OOB: return "a memory access is out of bounds";
    case TRAP_INT_OVERFLOW: return "integer overflow";
    case TRAP_DIV_BY_ZERO: return "integer division by zero";
    case TRAP_INVALID_CONVERSION: return "a NaN is converted to an integer";
    case TRAP_CALL_INDIRECT: return "an indirect call has no function";
    case TRAP_EXHAUSTION: return "the call stack is too deep";
    default: return "unreachable code was executed";
  }
}

/* ---- instances ---- */

static const char library = 0;

/* The instance of an importer's handle, unless null or another library's. */
static Instance *instance_of(void *handle) {
  const void *mark;
  if (!handle || (uintptr_t)handle % sizeof(void *)) return NULL;
  memcpy(&mark, handle, sizeof mark);
  return mark == &library ? handle : NULL;
}

/* An instance without a module, or null. */
static Instance *new_instance(const char *name, const char *token, const char *resources) {
  Instance *instance = malloc(sizeof *instance);
  if (!instance) return NULL;
  memset(instance, 0, offsetof(Instance, module.w2c_memory.data));
  instance->library = &library;
  instance->end_of_messages = &instance->messages;
  instance->name = copy_of(name);
  instance->token = copy_of(token);
  instance->resources = copy_of(resources);
  return instance;
}

static void free_module(Instance *instance) {
  if (!instance->has_module) return;
  Z_model_free(&instance->module);
  memset(&instance->module, 0, offsetof(Z_model_instance_t, w2c_memory.data));
  instance->has_module = instance->has_trapped = 0;
  instance->scratch = instance->scratch_size = 0;
  instance->is_scratch_used = 0;
}

static void free_memory(Instance *instance) {
  free_module(instance);
  free(instance->panic);
  free(instance->strings);
  free(instance->name);
  free(instance->token);
  free(instance->resources);
  free(instance->kept);
  free(instance);
}

/* ---- the floating-point environment ----

   The module rounds to nearest, keeps subnormal numbers and divides by zero without a trap, whatever the importer's
   settings, which are restored. On x86 only the SSE register matters; C's functions also set that of the x87 unit, which
   takes as long as a call. */

#if defined(__SSE2__) || defined(_M_X64)
#include <xmmintrin.h>

typedef unsigned int Environment;

static int is_default(Environment environment) {
  /* All exceptions are masked; past exceptions' flags do not matter. */
  return (environment & ~0x3fu) == 0x1f80;
}

static Environment use_default_environment(void) {
  const Environment importers = _mm_getcsr();
  if (!is_default(importers)) _mm_setcsr(0x1f80);
  return importers;
}

static void restore_environment(Environment importers) {
  if (!is_default(importers)) _mm_setcsr(importers);
}
#else
#include <fenv.h>

typedef fenv_t Environment;

static Environment use_default_environment(void) {
  Environment importers;
  fegetenv(&importers);
  fesetenv(FE_DFL_ENV);
  return importers;
}

static void restore_environment(Environment importers) {
  fesetenv(&importers);
}
#endif

/* ---- calls ---- */

/* Runs code that may trap; returns whether it did not. A trap is an error with a message. */
static int run(Instance *instance, Call *call, u32 *status) {
  wasm_rt_memory_t *memory = &instance->module.w2c_memory;
  jmp_buf *const outer = memory->unwind;
  jmp_buf here;
  const int trap = setjmp(here);
  if (trap) {
    memory->unwind = outer;
    if (instance->panic) {
      add_error(instance, call->name, "the model panicked: ", instance->panic, "; reset the instance");
    } else if (trap != TRAP_CALLBACK) {
      add_error(instance, call->name, "the model was stopped: ", explain(memory, trap), "; reset the instance");
    }
    free(instance->panic);
    instance->panic = NULL;
    return 0;
  }
  memory->unwind = &here;
  memory->is_exhausted = 0;
  *status = call->perform(instance, call);
  memory->unwind = outer;
  return 1;
}

/* Runs a call in the module's floating-point environment. */
static int guard(Instance *instance, Call *call, u32 *status) {
  const Environment importers = use_default_environment();
  const int has_returned = run(instance, call, status);
  restore_environment(importers);
  return has_returned;
}

/* Instantiation's pointer arguments: bytes, then strings. */
typedef struct {
  u32 bytes, name, token, resources, end;
} Passed;

static u32 put_text(Instance *instance, u32 *next, const char *text) {
  const u32 address = *next;
  if (!text) return 0;
  *next += (u32)strlen(text) + 1;
  memcpy(instance->module.w2c_memory.data + address, text, strlen(text) + 1);
  return address;
}

static Passed pass(Instance *instance, size_t bytes) {
  const size_t texts = (instance->name ? strlen(instance->name) : 0) + (instance->token ? strlen(instance->token) : 0) +
                       (instance->resources ? strlen(instance->resources) : 0) + 3;
  Passed passed;
  passed.bytes = allocate(instance, bytes + texts);
  check_range(&instance->module.w2c_memory, passed.bytes, bytes + texts);
  passed.end = passed.bytes + (u32)bytes;
  passed.name = put_text(instance, &passed.end, instance->name);
  passed.token = put_text(instance, &passed.end, instance->token);
  passed.resources = put_text(instance, &passed.end, instance->resources);
  passed.end = passed.bytes + (u32)(bytes + texts);
  return passed;
}

static void free_passed(Instance *instance, const Passed *passed) {
  Z_modelZ_fmu_free(&instance->module, passed->bytes, passed->end - passed->bytes);
}

static u32 make_module(Instance *instance, Call *call) {
  (void)call;
  instance->has_module = 1;
  Z_model_instantiate(&instance->module, (struct Z_fmu_instance_t *)instance);
  instance->handle = make_instance(instance);
  return 0;
}

/* Creates a module and its instance; returns whether that succeeded. */
static int make(Instance *instance, const char *name) {
  u32 status;
  Call call = {0};
  call.name = name;
  call.perform = make_module;
  instance->handle = 0;
  if (!guard(instance, &call, &status) || !instance->handle) free_module(instance);
  return instance->has_module;
}

static u32 fail(Instance *instance, Call *call) {
  (void)call;
  Z_modelZ_fmu_fail(&instance->module, instance->handle);
  return 0;
}

/* Renews the instance, which then needs a reset. */
static void renew(Instance *instance, const char *name) {
  Call failing = {0};
  u32 failed;
  failing.name = name;
  failing.perform = fail;
  free_module(instance);
  if (make(instance, name) && !guard(instance, &failing, &failed)) free_module(instance);
}

/* Finishes work on an instance: delivers its messages, and frees it if that was requested meanwhile. */
static void conclude(Instance *instance) {
  deliver(instance);
  if (--instance->calls == 0 && instance->is_freed) free_memory(instance);
}

/* Instantiates under a function's name; returns the instance, or null. */
static void *instantiate(Instance *instance, const char *name) {
  instance->calls = 1;
  instance->is_freed = !make(instance, name);
  if (!instance->is_freed) {
    conclude(instance);
    return instance;
  }
  conclude(instance);
  return NULL;
}

/* Performs a call. After a trap the instance is renewed; for a callback's call, once the outer call has trapped, too. */
static int perform(Instance *instance, Call *call) {
  void (*const unlock)(void) = instance->unlock;
  u32 status = STATUS_ERROR;
  if (instance->lock) instance->lock();
  instance->calls++;
  if (instance->has_trapped || !instance->has_module) {
    add_error(instance, call->name, instance->has_trapped ? "the model was stopped" : "out of memory", "", "");
  } else if (!guard(instance, call, &status)) {
    status = STATUS_ERROR;
    if (instance->module.w2c_memory.unwind) {
      instance->has_trapped = 1;
    } else if (!instance->is_freed) {
      renew(instance, call->name);
    }
  }
  conclude(instance);
  if (unlock) unlock();
  return (int)status;
}

static int call(void *handle, const char *name, wasm_rt_function_ptr_t function, Shape shape, Argument *arguments, int count) {
  Instance *instance = instance_of(handle);
  Call call = {0};
  if (!instance) return STATUS_ERROR;
  call.name = name;
  call.function = function;
  call.shape = shape;
  call.arguments = arguments;
  call.count = count;
  call.perform = marshal;
  return perform(instance, &call);
}

/* ---- saved states ---- */

/* A saved state, as bytes: a library's instances share them, and an invalid handle is an error. */
typedef struct State {
  struct State *next;
  const Instance *owner;
  size_t size;
  u8 *bytes;
} State;

/* The states of all instances: with its lock, the only shared data. */
static State *states;

/* Mutual exclusion, unless redefined on the command line. */
#if defined(ACQUIRE) && defined(RELEASE)
#elif defined(__GNUC__)
static volatile int lock;
#define ACQUIRE while (__sync_lock_test_and_set(&lock, 1)) continue
#define RELEASE __sync_lock_release(&lock)
#elif defined(_MSC_VER)
#include <intrin.h>
static volatile long lock;
#define ACQUIRE while (_InterlockedExchange(&lock, 1)) continue
#define RELEASE _InterlockedExchange(&lock, 0)
#elif defined(__STDC_VERSION__) && __STDC_VERSION__ >= 201112L && !defined(__STDC_NO_ATOMICS__)
#include <stdatomic.h>
static atomic_flag lock = ATOMIC_FLAG_INIT;
#define ACQUIRE while (atomic_flag_test_and_set(&lock)) continue
#define RELEASE atomic_flag_clear(&lock)
#else
#error "this compiler's atomic operations are unknown: README.txt explains -DACQUIRE= and -DRELEASE="
#endif

/* The link to a state, or null; requires the lock. */
static State **link_to(const void *handle) {
  State **link;
  for (link = &states; *link; link = &(*link)->next) {
    if (*link == handle) return link;
  }
  return NULL;
}

/* Stores bytes as a state, a new one if the handle is null; takes the bytes. Returns whether that succeeded. */
static int keep(const Instance *owner, void **handle, u8 *bytes, size_t size) {
  State **link, *state;
  ACQUIRE;
  link = link_to(*handle);
  state = link ? *link : malloc(sizeof *state);
  if (state) {
    if (link) {
      free(state->bytes);
    } else {
      state->owner = owner;
      state->next = states;
      states = state;
      *handle = state;
    }
    state->bytes = bytes;
    state->size = size;
  }
  RELEASE;
  if (!state) free(bytes);
  return state != NULL;
}

/* A copy of a state's bytes, or null. */
static u8 *copy_of_state(const void *handle, size_t *size) {
  State **link;
  u8 *copy = NULL;
  ACQUIRE;
  link = link_to(handle);
  if (link) {
    *size = (*link)->size;
    copy = malloc(*size);
    if (copy) memcpy(copy, (*link)->bytes, *size);
  }
  RELEASE;
  return copy;
}

/* Frees a state, or all of an instance. */
static void free_states(const void *handle, const Instance *owner) {
  State **link, *state;
  ACQUIRE;
  for (link = &states; *link;) {
    state = *link;
    if (state == handle || state->owner == owner) {
      *link = state->next;
      free(state->bytes);
      free(state);
    } else {
      link = &state->next;
    }
  }
  RELEASE;
}

static void free_instance(void *handle) {
  Instance *instance = instance_of(handle);
  if (!instance) return;
  free_states(NULL, instance);
  /* Later calls no longer take it for an instance. */
  instance->library = NULL;
  if (instance->calls) {
    instance->is_freed = 1;
  } else {
    free_memory(instance);
  }
}

/* ---- the functions ---- */

/* A function of the module: its name and parameters, the types of its arguments, and these. */
#define FUNCTION(name, parameters, shape, ...)                                                 \
  EXPORT int FMI(name) parameters {                                                            \
    Argument arguments[] = {__VA_ARGS__};                                                      \
    return call(instance, #name, (wasm_rt_function_ptr_t)Z_modelZ_##name, shape, arguments,    \
                (int)(sizeof arguments / sizeof *arguments));                                  \
  }
#define TRANSITION(name)                                                                       \
  EXPORT int FMI(name)(void *instance) {                                                       \
    return call(instance, #name, (wasm_rt_function_ptr_t)Z_modelZ_##name, INTEGERS, NULL, 0);  \
  }
/* The module checks counts before it writes or reads. */
#define VECTOR(name, type, argument, count, elements, ARGUMENT)                                \
  EXPORT int FMI(name)(void *instance, type argument[], size_t count) {                        \
    Argument arguments[] = {ARGUMENT(argument, count == elements ? count : 0), SIZE(count)};   \
    if (count > UINT32_MAX) return refuse_count(instance, #name, #count, count, elements);     \
    return call(instance, #name, (wasm_rt_function_ptr_t)Z_modelZ_##name, INTEGERS, arguments, 2); \
  }

#ifdef HAS_STATES
/* Rejects, as the module would, a count that does not fit it. */
static int refuse_count(void *handle, const char *name, const char *argument, size_t count, unsigned int elements) {
  Instance *instance = instance_of(handle);
  char text[100];
  if (!instance) return STATUS_ERROR;
  snprintf(text, sizeof text, "%s is %llu; this FMU has %u", argument, (unsigned long long)count, elements);
  instance->calls++;
  add_error(instance, name, text, "", "");
  conclude(instance);
  return STATUS_ERROR;
}
#endif
