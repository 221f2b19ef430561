/* Shared by all FMI versions: instances, each with its own module and memory; calls of the module's functions, with
   arguments copied in and results copied out; messages; saved states.

   The file that includes this has defined `Importer`, and then the two functions that are declared here. */

#include <stdio.h>
#include <stdlib.h>

#include "model.h"

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

enum { STATUS_OK, STATUS_WARNING, STATUS_DISCARD, STATUS_ERROR };

/* A message held until the function returns or calls the importer: the logger may then call or free the instance. */
typedef struct Message {
  struct Message *next;
  int status;
  char *category, *text;
} Message;

typedef struct Instance {
  /* This library's mark, not shared by instances of other libraries. */
  const void *library;
  int has_module;
  /* The instance in the module. */
  u32 handle;
  /* Memory in the module for arguments and results. */
  u32 scratch, scratch_size;
  int is_scratch_used;
  Message *messages, **end_of_messages;
  /* The message of a panic, until the trap that follows. */
  char *panic;
  /* The strings or binaries returned last. */
  char *strings;
  /* Pending calls: more than one if a callback calls the instance. */
  int calls;
  /* Whether such a call trapped, or freed the instance. */
  int has_trapped, is_freed;
  /* The arguments of instantiation. */
  char *name, *token, *resources;
  void *environment;
  void (*logger)(void);
  int is_logging;
  Importer importer;
  /* Memory it points to. */
  void *kept;
  /* Called around each call if the importer schedules model partitions. */
  void (*lock)(void), (*unlock)(void);
  Z_model_instance_t module;
} Instance;

/* Calls the importer's logger. */
static void log_message(const Instance *instance, const Message *message);

/* Instantiates in a new module: the handle there, or 0. */
static u32 make_instance(Instance *instance);

/* A function's argument. Even after errors, results written by the module are returned. */
typedef struct {
  enum {
    INTEGER_ARGUMENT,
    REAL_ARGUMENT,
    IN_ARGUMENT,
    OUT_ARGUMENT,
    ANYWAY_OUT_ARGUMENT,
    SIZES_ARGUMENT,
    SIZES_OUT_ARGUMENT,
    TEXTS_ARGUMENT,
    TEXTS_OUT_ARGUMENT,
    /* These follow their sizes. */
    BINARIES_ARGUMENT,
    BINARIES_OUT_ARGUMENT
  } kind;
  const void *in;
  void *out;
  /* Of elements in the module's format. */
  size_t count, size;
  u32 integer;
  f64 real;
} Argument;

#define INTEGER(value) {INTEGER_ARGUMENT, NULL, NULL, 0, 0, (u32)(value), 0}
#define SIZE(value) {INTEGER_ARGUMENT, NULL, NULL, 0, 0, as_size(value), 0}
#define REAL(value) {REAL_ARGUMENT, NULL, NULL, 0, 0, 0, value}
#define ARRAY(array, count) {IN_ARGUMENT, array, NULL, count, sizeof *(array), 0, 0}
#define RESULT(array, count) {OUT_ARGUMENT, NULL, array, count, sizeof *(array), 0, 0}
#define RESULT_ANYWAY(array, count) {ANYWAY_OUT_ARGUMENT, NULL, array, count, sizeof *(array), 0, 0}
#define SIZES(array, count) {SIZES_ARGUMENT, array, NULL, count, sizeof(u32), 0, 0}
#define SIZES_RESULT(array, count) {SIZES_OUT_ARGUMENT, NULL, array, count, sizeof(u32), 0, 0}
#define TEXTS(array, count) {TEXTS_ARGUMENT, array, NULL, count, sizeof(u32), 0, 0}
#define TEXTS_RESULT(array, count) {TEXTS_OUT_ARGUMENT, NULL, (void *)(array), count, sizeof(u32), 0, 0}
#define BINARIES(array, count) {BINARIES_ARGUMENT, array, NULL, count, sizeof(u32), 0, 0}
#define BINARIES_RESULT(array, count) {BINARIES_OUT_ARGUMENT, NULL, (void *)(array), count, sizeof(u32), 0, 0}

/* The types of a function's arguments after the instance: only integers, or by letter. */
typedef enum { INTEGERS, D, DDI, DDIIIII, ID, IDDID } Shape;

/* A call of an instance. */
typedef struct Call {
  const char *name;
  wasm_rt_function_ptr_t function;
  Shape shape;
  Argument *arguments;
  int count;
  /* Its action on the module. */
  u32 (*perform)(Instance *instance, struct Call *call);
  /* For state functions: a handle, or its address. */
  void *handle;
  void *state;
  u8 *bytes;
  size_t size;
} Call;

/* A 32-bit size; a too large one stays too large. */
static u32 as_size(size_t size) {
  return size > UINT32_MAX ? UINT32_MAX : (u32)size;
}

static char *copy_of(const char *text) {
  char *copy = text ? malloc(strlen(text) + 1) : NULL;
  return copy ? strcpy(copy, text) : NULL;
}

/* Why a call of a module trapped. */
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

/* ---- messages ---- */

/* Appends a message if memory allows; takes the strings. */
static void add_message(Instance *instance, int status, char *category, char *text) {
  Message *message = malloc(sizeof *message);
  if (!message || !category || !text) {
    free(message);
    free(category);
    free(text);
    return;
  }
  message->next = NULL;
  message->status = status;
  message->category = category;
  message->text = text;
  *instance->end_of_messages = message;
  instance->end_of_messages = &message->next;
}

/* A function's error: `#` is doubled for FMI 2.0 loggers. */
static void add_error(Instance *instance, const char *function, const char *before, const char *what, const char *after) {
  const char *parts[5];
  size_t length = 1, part;
  char *text, *end;
  if (!instance->logger) return;
  parts[0] = function;
  parts[1] = ": ";
  parts[2] = before;
  parts[3] = what;
  parts[4] = after;
  for (part = 0; part < 5; part++) length += 2 * strlen(parts[part]);
  text = end = malloc(length);
  if (!text) return;
  for (part = 0; part < 5; part++) {
    const char *rest;
    for (rest = parts[part]; *rest; rest++) {
      if (*rest == '#') *end++ = '#';
      *end++ = *rest;
    }
  }
  *end = 0;
  add_message(instance, STATUS_ERROR, copy_of("logStatusError"), text);
}

/* Logs pending messages during a call. */
static void deliver(Instance *instance) {
  Message *message;
  while ((message = instance->messages) != NULL) {
    instance->messages = message->next;
    if (!message->next) instance->end_of_messages = &instance->messages;
    if (instance->logger) log_message(instance, message);
    free(message->category);
    free(message->text);
    free(message);
  }
}

/* ---- what modules import ---- */

/* A copy of a string in the module's memory, which ends in 0 or has the given size. */
static char *string_at(Instance *instance, u32 address, u32 size) {
  wasm_rt_memory_t *memory = &instance->module.w2c_memory;
  char *text;
  check_range(memory, address, 1);
  if (size == UINT32_MAX) {
    const u8 *end = memchr(memory->data + address, 0, sizeof memory->data - address);
    if (!end) wasm_trap(memory, TRAP_OOB);
    size = (u32)(end - (memory->data + address));
  }
  check_range(memory, address, size);
  text = malloc((size_t)size + 1);
  if (text) {
    memcpy(text, memory->data + address, size);
    text[size] = 0;
  }
  return text;
}

void Z_fmuZ_log(struct Z_fmu_instance_t *host, u32 environment, u32 status, u32 category, u32 text) {
  Instance *instance = (Instance *)host;
  (void)environment;
  add_message(instance, (int)status, string_at(instance, category, UINT32_MAX), string_at(instance, text, UINT32_MAX));
}

void Z_fmuZ_panic(struct Z_fmu_instance_t *host, u32 text, u32 size) {
  Instance *instance = (Instance *)host;
  free(instance->panic);
  instance->panic = string_at(instance, text, size);
}

#ifdef Z_fmuZ_file_size
u64 Z_fmuZ_file_size(struct Z_fmu_instance_t *host, u32 path, u32 path_size) {
  char *name = string_at((Instance *)host, path, path_size);
  FILE *file = name ? fopen(name, "rb") : NULL;
  long size = -1;
  if (file) {
    if (fseek(file, 0, SEEK_END) == 0) size = ftell(file);
    fclose(file);
  }
  free(name);
  return (u64)(s64)size;
}

u32 Z_fmuZ_read_file(struct Z_fmu_instance_t *host, u32 path, u32 path_size, u32 bytes, u32 size) {
  Instance *instance = (Instance *)host;
  char *name = string_at(instance, path, path_size);
  FILE *file = name ? fopen(name, "rb") : NULL;
  u32 is_read = 0;
  free(name);
  if (file) {
    wasm_rt_memory_t *memory = &instance->module.w2c_memory;
    is_read = (u64)bytes + size <= sizeof memory->data && fread(memory->data + bytes, 1, size, file) == size;
    fclose(file);
  }
  return is_read;
}
#endif

/* ---- arguments and results ---- */

/* Numbers to or from a module's memory. */
static void copy_numbers(void *to, const void *from, size_t count, size_t size) {
  size_t i;
  for (i = 0; i < count; i++) copy_number((char *)to + i * size, (const char *)from + i * size, size);
}

/* The place of the next argument in the scratch memory. */
static u32 place(u32 *next, u64 size) {
  const u32 address = *next;
  *next += (u32)((size + 7) & ~(u64)7);
  return address;
}

/* Sizes to the module, and from it. */
static void put_sizes(u8 *to, const void *sizes, size_t count) {
  size_t i;
  for (i = 0; i < count; i++) {
    size_t size;
    u32 number;
    memcpy(&size, (const char *)sizes + i * sizeof size, sizeof size);
    number = as_size(size);
    copy_number(to + 4 * i, &number, sizeof number);
  }
}

static void take_sizes(void *sizes, const u8 *from, size_t count) {
  size_t i;
  for (i = 0; i < count; i++) {
    u32 number;
    size_t size;
    copy_number(&number, from + 4 * i, sizeof number);
    size = number;
    memcpy((char *)sizes + i * sizeof size, &size, sizeof size);
  }
}

/* Marks results that the module did not write: no flag or time consists of such bytes. */
#define UNWRITTEN 0xff
static void take_written(void *to, const u8 *from, size_t count, size_t size) {
  size_t i, byte;
  for (i = 0; i < count; i++, from += size) {
    for (byte = 0; byte < size && from[byte] == UNWRITTEN; byte++) continue;
    if (byte < size) copy_number((char *)to + i * size, from, size);
  }
}

/* A string or binary of an array at any address, and its size in bytes; null if the importer's pointer is. */
static const char *text_of(const Argument *argument, size_t index, size_t *size) {
  const Argument *sizes = argument - 1;
  const char *text;
  memcpy(&text, (const char *)argument->in + index * sizeof text, sizeof text);
  *size = 0;
  if (!text) return NULL;
  if (argument->kind == TEXTS_ARGUMENT) *size = strlen(text) + 1;
  else if (sizes->in) memcpy(size, (const char *)sizes->in + index * sizeof *size, sizeof *size);
  return text;
}

static int has_texts(const Argument *argument) {
  return argument->kind == TEXTS_ARGUMENT || argument->kind == BINARIES_ARGUMENT;
}

/* More than a module can address. */
#define TOO_MUCH ((u64)1 << 40)

/* The bytes of an argument in the scratch memory. */
static u64 bytes_of(const Argument *argument) {
  u64 bytes = argument->count > UINT32_MAX ? TOO_MUCH : ((u64)argument->count * argument->size + 7) & ~(u64)7;
  size_t i, size;
  if (has_texts(argument)) {
    for (i = 0; i < argument->count && bytes < TOO_MUCH; i++) {
      const u64 length = text_of(argument, i, &size) ? size : 0;
      bytes += length < TOO_MUCH ? (length + 7) & ~(u64)7 : TOO_MUCH;
    }
  }
  return bytes;
}

static int is_array(const Argument *argument) {
  return argument->kind >= IN_ARGUMENT && argument->count > 0 && (argument->in || argument->out);
}

/* Memory for a call's arguments; reuses that of the last call if large enough. */
static u32 scratch_of(Instance *instance, u64 size, u32 *allocated) {
  *allocated = 0;
  if (size == 0) return 0;
  if (!instance->is_scratch_used && size <= instance->scratch_size) {
    instance->is_scratch_used = 1;
    return instance->scratch;
  }
  *allocated = Z_modelZ_fmu_allocate(&instance->module, as_size((size_t)(size > UINT32_MAX ? UINT32_MAX : size)));
  if (!*allocated) {
    instance->module.w2c_memory.is_exhausted = 1;
    wasm_trap(&instance->module.w2c_memory, TRAP_UNREACHABLE);
  }
  if (instance->is_scratch_used) return *allocated;
  if (instance->scratch) Z_modelZ_fmu_free(&instance->module, instance->scratch, instance->scratch_size);
  instance->scratch = *allocated;
  instance->scratch_size = (u32)size;
  instance->is_scratch_used = 1;
  *allocated = 0;
  return instance->scratch;
}

static u32 invoke(Instance *instance, const Call *call, const u32 *integers) {
  typedef Z_model_instance_t *M;
  const Argument *arguments = call->arguments;
  const M module = &instance->module;
  const u32 handle = instance->handle, *a = integers;
  switch (call->shape) {
    case D: return ((u32(*)(M, u32, f64))call->function)(module, handle, arguments[0].real);
    case ID: return ((u32(*)(M, u32, u32, f64))call->function)(module, handle, a[0], arguments[1].real);
    case DDI:
      return ((u32(*)(M, u32, f64, f64, u32))call->function)(module, handle, arguments[0].real, arguments[1].real, a[2]);
    case DDIIIII:
      return ((u32(*)(M, u32, f64, f64, u32, u32, u32, u32, u32))call->function)(
          module, handle, arguments[0].real, arguments[1].real, a[2], a[3], a[4], a[5], a[6]);
    case IDDID:
      return ((u32(*)(M, u32, u32, f64, f64, u32, f64))call->function)(module, handle, a[0], arguments[1].real,
                                                                       arguments[2].real, a[3], arguments[4].real);
    default: break;
  }
  switch (call->count) {
    case 0: return ((u32(*)(M, u32))call->function)(module, handle);
    case 1: return ((u32(*)(M, u32, u32))call->function)(module, handle, a[0]);
    case 2: return ((u32(*)(M, u32, u32, u32))call->function)(module, handle, a[0], a[1]);
    case 3: return ((u32(*)(M, u32, u32, u32, u32))call->function)(module, handle, a[0], a[1], a[2]);
    case 4: return ((u32(*)(M, u32, u32, u32, u32, u32))call->function)(module, handle, a[0], a[1], a[2], a[3]);
    case 5:
      return ((u32(*)(M, u32, u32, u32, u32, u32, u32))call->function)(module, handle, a[0], a[1], a[2], a[3], a[4]);
    case 6:
      return ((u32(*)(M, u32, u32, u32, u32, u32, u32, u32))call->function)(module, handle, a[0], a[1], a[2], a[3], a[4],
                                                                            a[5]);
    default:
      return ((u32(*)(M, u32, u32, u32, u32, u32, u32, u32, u32, u32))call->function)(
          module, handle, a[0], a[1], a[2], a[3], a[4], a[5], a[6], a[7]);
  }
}

/* The size of the module's string or binary in bytes; binaries have `sizes`. */
static u32 size_at(wasm_rt_memory_t *memory, u32 address, u32 sizes, size_t index) {
  const u8 *end;
  u32 size;
  if (sizes) {
    size = i32_load(memory, sizes + 4 * (u64)index);
    check_range(memory, address, size);
    return size;
  }
  check_range(memory, address, 1);
  end = memchr(memory->data + address, 0, sizeof memory->data - address);
  if (!end) wasm_trap(memory, TRAP_OOB);
  return (u32)(end - (memory->data + address)) + 1;
}

/* Copies the module's strings or binaries, from an array of addresses, to the instance's memory. */
static void take_strings(Instance *instance, u32 addresses, u32 sizes, void *texts, size_t count) {
  wasm_rt_memory_t *memory = &instance->module.w2c_memory;
  size_t size = 1, i;
  char *end;
  for (i = 0; i < count; i++) size += size_at(memory, i32_load(memory, addresses + 4 * (u64)i), sizes, i);
  free(instance->strings);
  instance->strings = end = malloc(size);
  if (!end) {
    memory->is_exhausted = 1;
    wasm_trap(memory, TRAP_UNREACHABLE);
  }
  for (i = 0; i < count; i++) {
    const u32 address = i32_load(memory, addresses + 4 * (u64)i);
    const u32 bytes = size_at(memory, address, sizes, i);
    memcpy(end, memory->data + address, bytes);
    memcpy((char *)texts + i * sizeof end, &end, sizeof end);
    end += bytes;
  }
}

/* Calls a function of the module. */
static u32 marshal(Instance *instance, Call *call) {
  wasm_rt_memory_t *memory = &instance->module.w2c_memory;
  u32 integers[8] = {0}, allocated, next, status;
  u64 size = 0;
  int i;
  for (i = 0; i < call->count; i++) {
    if (is_array(&call->arguments[i])) size += bytes_of(&call->arguments[i]);
  }
  next = scratch_of(instance, size, &allocated);
  for (i = 0; i < call->count; i++) {
    const Argument *argument = &call->arguments[i];
    integers[i] = argument->integer;
    if (is_array(argument)) {
      const u64 bytes = (u64)argument->count * argument->size;
      integers[i] = place(&next, bytes);
      check_range(memory, integers[i], bytes);
      if (argument->kind == IN_ARGUMENT) copy_numbers(memory->data + integers[i], argument->in, argument->count, argument->size);
      if (argument->kind == SIZES_ARGUMENT) put_sizes(memory->data + integers[i], argument->in, argument->count);
      if (argument->kind == ANYWAY_OUT_ARGUMENT) memset(memory->data + integers[i], UNWRITTEN, (size_t)bytes);
      if (has_texts(argument)) {
        size_t index, length;
        for (index = 0; index < argument->count; index++) {
          const char *text = text_of(argument, index, &length);
          const u32 address = text ? place(&next, length) : 0;
          i32_store(memory, integers[i] + 4 * (u64)index, address);
          check_range(memory, address, length);
          if (length) memcpy(memory->data + address, text, length);
        }
      }
    }
  }
  status = invoke(instance, call, integers);
  for (i = 0; i < call->count; i++) {
    const Argument *argument = &call->arguments[i];
    const u8 *found = memory->data + integers[i];
    if (!is_array(argument)) continue;
    if (argument->kind == ANYWAY_OUT_ARGUMENT) take_written(argument->out, found, argument->count, argument->size);
    if (status > STATUS_WARNING) continue;
    if (argument->kind == OUT_ARGUMENT) copy_numbers(argument->out, found, argument->count, argument->size);
    if (argument->kind == SIZES_OUT_ARGUMENT) take_sizes(argument->out, found, argument->count);
    if (argument->kind == TEXTS_OUT_ARGUMENT) take_strings(instance, integers[i], 0, argument->out, argument->count);
    if (argument->kind == BINARIES_OUT_ARGUMENT) {
      take_strings(instance, integers[i], integers[i - 1], argument->out, argument->count);
    }
  }
  if (allocated) {
    Z_modelZ_fmu_free(&instance->module, allocated, (u32)size);
  } else if (size) {
    instance->is_scratch_used = 0;
  }
  return status;
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

/* Likewise in the module's floating-point environment. */
static int guard(Instance *instance, Call *call, u32 *status) {
  const Environment importers = use_default_environment();
  const int has_returned = run(instance, call, status);
  restore_environment(importers);
  return has_returned;
}

/* Memory in the module; freed manually, as a trap frees the module. */
static u32 allocate(Instance *instance, size_t size) {
  const u32 address = Z_modelZ_fmu_allocate(&instance->module, as_size(size));
  if (!address) {
    instance->module.w2c_memory.is_exhausted = 1;
    wasm_trap(&instance->module.w2c_memory, TRAP_UNREACHABLE);
  }
  return address;
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
