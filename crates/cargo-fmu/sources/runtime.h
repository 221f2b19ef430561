/* What the functions of every version of FMI have in common: instances, each with a module and memory of its own; calls of
   the module's functions, with arguments copied in and results copied out; messages; saved states. */

#include <stdio.h>
#include <stdlib.h>

#include "model.h"

enum { STATUS_OK, STATUS_WARNING, STATUS_DISCARD, STATUS_ERROR };

/* A message that waits until the function returns: then the importer's logger may call the instance, or free it. */
typedef struct Message {
  struct Message *next;
  int status;
  char *category, *text;
} Message;

typedef struct Instance {
  /* This library's mark, which no other library's instances have. */
  const void *library;
  Z_model_instance_t module;
  int has_module;
  /* The instance in the module. */
  u32 handle;
  /* Instantiates in a new module: its handle, or 0. */
  u32 (*make)(struct Instance *instance);
  jmp_buf unwind;
  /* Memory in the module for arguments and results. */
  u32 scratch, scratch_size;
  int is_scratch_used;
  Message *messages, **end_of_messages;
  /* The message of a panic, until the trap that follows. */
  char *panic;
  /* The strings that were got last. */
  char *strings;
  /* Calls the importer's logger. */
  void (*log)(const struct Instance *instance, const Message *message);
  /* What was passed at instantiation. */
  char *name, *token, *resources;
  void *environment;
  void (*logger)(void);
  int type, is_logging;
} Instance;

/* An argument of a function. */
typedef struct {
  enum { INTEGER_ARGUMENT, REAL_ARGUMENT, IN_ARGUMENT, OUT_ARGUMENT, TEXTS_ARGUMENT, TEXTS_OUT_ARGUMENT } kind;
  const void *in;
  void *out;
  size_t count, size;
  u32 integer;
  f64 real;
} Argument;

#define INTEGER(value) {INTEGER_ARGUMENT, NULL, NULL, 0, 0, (u32)(value), 0}
#define SIZE(value) {INTEGER_ARGUMENT, NULL, NULL, 0, 0, as_size(value), 0}
#define REAL(value) {REAL_ARGUMENT, NULL, NULL, 0, 0, 0, value}
#define ARRAY(array, count) {IN_ARGUMENT, array, NULL, count, sizeof *(array), 0, 0}
#define RESULT(array, count) {OUT_ARGUMENT, NULL, array, count, sizeof *(array), 0, 0}
#define TEXTS(array, count) {TEXTS_ARGUMENT, array, NULL, count, sizeof(u32), 0, 0}
#define TEXTS_RESULT(array, count) {TEXTS_OUT_ARGUMENT, NULL, (void *)(array), count, sizeof(u32), 0, 0}

/* The types of a function's arguments behind the instance: integers alone, or by letters. */
typedef enum { INTEGERS, D, DDI, IDDID } Shape;

/* A call of an instance. */
typedef struct Call {
  const char *name;
  wasm_rt_function_ptr_t function;
  Shape shape;
  Argument *arguments;
  int count;
  /* What it does with the module. */
  u32 (*perform)(Instance *instance, struct Call *call);
  /* Of functions of states: a handle, or where one is. */
  void *handle;
  void *state;
  u8 *bytes;
  size_t size;
} Call;

/* A size of 32 bits; one that is too large stays too large. */
static u32 as_size(size_t size) {
  return size > UINT32_MAX ? UINT32_MAX : (u32)size;
}

static char *copy_of(const char *text) {
  char *copy = text ? malloc(strlen(text) + 1) : NULL;
  return copy ? strcpy(copy, text) : NULL;
}

/* ---- the memory of modules ---- */

#define PAGE 65536u

void wasm_rt_allocate_memory(wasm_rt_memory_t *memory, u32 pages, u32 max_pages) {
  /* 4 GB less a page can be counted. */
  memory->max_pages = max_pages < 65535 ? max_pages : 65535;
  memory->data = calloc(pages ? pages : 1, PAGE);
  memory->pages = memory->data ? pages : 0;
  memory->size = memory->pages * PAGE;
  if (!memory->data) {
    memory->is_exhausted = 1;
    wasm_trap(memory, TRAP_UNREACHABLE);
  }
}

u32 wasm_rt_grow_memory(wasm_rt_memory_t *memory, u32 pages) {
  const u32 before = memory->pages;
  u8 *data = NULL;
  if (pages == 0) return before;
  if (pages <= memory->max_pages - before && (size_t)before + pages <= SIZE_MAX / PAGE) {
    data = realloc(memory->data, ((size_t)before + pages) * PAGE);
  }
  if (!data) {
    memory->is_exhausted = 1;
    return UINT32_MAX;
  }
  memset(data + memory->size, 0, (size_t)pages * PAGE);
  memory->data = data;
  memory->pages += pages;
  memory->size = memory->pages * PAGE;
  return before;
}

void wasm_rt_free_memory(wasm_rt_memory_t *memory) {
  free(memory->data);
  memory->data = NULL;
}

void wasm_rt_allocate_funcref_table(wasm_rt_funcref_table_t *table, u32 size, u32 max_size) {
  table->data = calloc(size ? size : 1, sizeof *table->data);
  table->size = table->data ? size : 0;
  table->max_size = max_size;
}

void wasm_rt_free_funcref_table(wasm_rt_funcref_table_t *table) {
  free(table->data);
  table->data = NULL;
}

void wasm_trap(wasm_rt_memory_t *memory, Trap trap) {
  longjmp(*memory->unwind, (int)trap);
}

static const char *explain(const wasm_rt_memory_t *memory, int trap) {
  if (memory->is_exhausted) return "there is no more memory";
  switch (trap) {
    case TRAP_OOB: return "an access is outside of the memory";
    case TRAP_INT_OVERFLOW: return "an integer overflows";
    case TRAP_DIV_BY_ZERO: return "an integer is divided by zero";
    case TRAP_INVALID_CONVERSION: return "not a number becomes an integer";
    case TRAP_CALL_INDIRECT: return "a call has no function";
    case TRAP_EXHAUSTION: return "calls are too deep";
    default: return "unreachable code is reached";
  }
}

/* ---- messages ---- */

/* Appends a message, unless there is no memory for it; takes the strings. */
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

/* The error of a function: `#` is doubled, as loggers of FMI 2.0 read it. */
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

/* Logs what has been said. The instance may be gone afterwards. */
static void deliver(Instance *instance) {
  Message *message = instance->messages;
  Instance recipient = *instance;
  char *name = message ? copy_of(instance->name) : NULL;
  recipient.name = name;
  instance->messages = NULL;
  instance->end_of_messages = &instance->messages;
  while (message) {
    Message *next = message->next;
    if (recipient.logger) recipient.log(&recipient, message);
    free(message->category);
    free(message->text);
    free(message);
    message = next;
  }
  free(name);
}

/* ---- what modules import ---- */

/* A copy of a string in the module's memory, which ends in 0 or is given its size. */
static char *string_at(Instance *instance, u32 address, u32 size) {
  wasm_rt_memory_t *memory = &instance->module.w2c_memory;
  char *text;
  check_range(memory, address, 1);
  if (size == UINT32_MAX) {
    const u8 *end = memchr(memory->data + address, 0, memory->size - address);
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
    const wasm_rt_memory_t *memory = &instance->module.w2c_memory;
    is_read = (u64)bytes + size <= memory->size && fread(memory->data + bytes, 1, size, file) == size;
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

/* Where the next argument of a size goes, in the scratch memory. */
static u32 place(u32 *next, u64 size) {
  const u32 address = *next;
  *next += (u32)((size + 7) & ~(u64)7);
  return address;
}

/* A string of an array at any address. */
static const char *text_of(const void *texts, size_t index) {
  const char *text;
  memcpy(&text, (const char *)texts + index * sizeof text, sizeof text);
  return text;
}

/* The bytes of an argument in the scratch memory. */
static u64 bytes_of(const Argument *argument) {
  /* More than a module can have is as much as fails. */
  u64 bytes = argument->count > UINT32_MAX ? (u64)1 << 40 : ((u64)argument->count * argument->size + 7) & ~(u64)7;
  size_t i;
  if (argument->kind == TEXTS_ARGUMENT) {
    for (i = 0; i < argument->count; i++) {
      const char *text = text_of(argument->in, i);
      if (text) bytes += (strlen(text) + 8) & ~(u64)7;
    }
  }
  return bytes;
}

static int is_array(const Argument *argument) {
  return argument->kind >= IN_ARGUMENT && argument->count > 0 && (argument->in || argument->out);
}

/* Memory for the arguments of a call; that of the last call, if it is large enough. */
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
    case DDI:
      return ((u32(*)(M, u32, f64, f64, u32))call->function)(module, handle, arguments[0].real, arguments[1].real, a[2]);
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
    default:
      return ((u32(*)(M, u32, u32, u32, u32, u32, u32, u32))call->function)(module, handle, a[0], a[1], a[2], a[3], a[4],
                                                                            a[5]);
  }
}

/* Copies strings of the module, whose addresses are at an address, to memory of the instance. */
static void take_strings(Instance *instance, u32 addresses, void *texts, size_t count) {
  wasm_rt_memory_t *memory = &instance->module.w2c_memory;
  size_t size = 1, i;
  char *end;
  for (i = 0; i < count; i++) {
    const u32 address = i32_load(memory, addresses + 4 * (u64)i);
    const u8 *last;
    check_range(memory, address, 1);
    last = memchr(memory->data + address, 0, memory->size - address);
    if (!last) wasm_trap(memory, TRAP_OOB);
    size += (size_t)(last - (memory->data + address)) + 1;
  }
  free(instance->strings);
  instance->strings = end = malloc(size);
  if (!end) {
    memory->is_exhausted = 1;
    wasm_trap(memory, TRAP_UNREACHABLE);
  }
  for (i = 0; i < count; i++) {
    strcpy(end, (const char *)memory->data + i32_load(memory, addresses + 4 * (u64)i));
    memcpy((char *)texts + i * sizeof end, &end, sizeof end);
    end += strlen(end) + 1;
  }
}

/* Calls a function of the module. */
static u32 marshal(Instance *instance, Call *call) {
  wasm_rt_memory_t *memory = &instance->module.w2c_memory;
  u32 integers[6] = {0}, allocated, next, status;
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
      if (argument->kind == TEXTS_ARGUMENT) {
        size_t index;
        for (index = 0; index < argument->count; index++) {
          const char *text = text_of(argument->in, index);
          const size_t length = text ? strlen(text) + 1 : 0;
          const u32 address = length ? place(&next, length) : 0;
          i32_store(memory, integers[i] + 4 * (u64)index, address);
          check_range(memory, address, length);
          if (length) memcpy(memory->data + address, text, length);
        }
      }
    }
  }
  status = invoke(instance, call, integers);
  for (i = 0; i < call->count && status <= STATUS_WARNING; i++) {
    const Argument *argument = &call->arguments[i];
    if (!is_array(argument)) continue;
    if (argument->kind == OUT_ARGUMENT) {
      copy_numbers(argument->out, memory->data + integers[i], argument->count, argument->size);
    } else if (argument->kind == TEXTS_OUT_ARGUMENT) {
      take_strings(instance, integers[i], argument->out, argument->count);
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

/* The instance of an importer's handle, unless that is null or another library's. */
static Instance *instance_of(void *handle) {
  const void *mark;
  if (!handle || (uintptr_t)handle % sizeof(void *)) return NULL;
  memcpy(&mark, handle, sizeof mark);
  return mark == &library ? handle : NULL;
}

static void free_module(Instance *instance) {
  if (!instance->has_module) return;
  Z_model_free(&instance->module);
  memset(&instance->module, 0, sizeof instance->module);
  instance->has_module = 0;
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
  /* Not an instance any more, whatever the memory is used for next. */
  instance->library = NULL;
  free(instance);
}

/* Runs code that may trap: whether it did not. A trap is an error with a message. */
static int guard(Instance *instance, Call *call, u32 *status) {
  const int trap = setjmp(instance->unwind);
  if (trap) {
    const char *why = explain(&instance->module.w2c_memory, trap);
    if (instance->panic) {
      add_error(instance, call->name, "the model panicked: ", instance->panic, "; reset the instance");
    } else {
      add_error(instance, call->name, "the model was stopped: ", why, "; reset the instance");
    }
    free(instance->panic);
    instance->panic = NULL;
    return 0;
  }
  instance->module.w2c_memory.unwind = &instance->unwind;
  instance->module.w2c_memory.depth = 0;
  instance->module.w2c_memory.is_exhausted = 0;
  *status = call->perform(instance, call);
  return 1;
}

static u32 make_module(Instance *instance, Call *call) {
  (void)call;
  instance->has_module = 1;
  Z_model_instantiate(&instance->module, (struct Z_fmu_instance_t *)instance);
  instance->handle = instance->make(instance);
  return 0;
}

/* Makes a module and the instance in it: whether that succeeded. */
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

/* Performs a call. After a trap the instance is a new one that waits to be reset. */
static int perform(Instance *instance, Call *call) {
  u32 status = STATUS_ERROR;
  if (!instance->has_module) {
    add_error(instance, call->name, "there is no more memory", "", "");
  } else if (!guard(instance, call, &status)) {
    Call failing = {0};
    failing.name = call->name;
    failing.perform = fail;
    free_module(instance);
    status = STATUS_ERROR;
    if (make(instance, call->name)) {
      u32 failed;
      if (!guard(instance, &failing, &failed)) free_module(instance);
    }
  }
  deliver(instance);
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

/* A saved state, as its bytes: the instances of a library take each other's, and a handle that is none is an error. */
typedef struct State {
  struct State *next;
  const Instance *owner;
  size_t size;
  u8 *bytes;
} State;

/* The states of all instances: with the lock that guards it, all that instances share. */
static State *states;
static volatile long lock;

#if defined(__GNUC__)
#define ACQUIRE() while (__sync_lock_test_and_set(&lock, 1)) continue
#define RELEASE() __sync_lock_release(&lock)
#elif defined(_MSC_VER)
#include <intrin.h>
#define ACQUIRE() while (_InterlockedExchange(&lock, 1)) continue
#define RELEASE() _InterlockedExchange(&lock, 0)
#else
#error "define ACQUIRE and RELEASE here, by which one thread at a time sets lock to 1 and back to 0"
#endif

/* The link to a state, or null; the lock is held. */
static State **link_to(const void *handle) {
  State **link;
  for (link = &states; *link; link = &(*link)->next) {
    if (*link == handle) return link;
  }
  return NULL;
}

/* Keeps bytes as a state: a new one where the handle is null; takes the bytes. Whether that succeeded. */
static int keep(const Instance *owner, void **handle, u8 *bytes, size_t size) {
  State **link, *state;
  ACQUIRE();
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
  RELEASE();
  if (!state) free(bytes);
  return state != NULL;
}

/* A copy of the bytes of a state, or null. */
static u8 *copy_of_state(const void *handle, size_t *size) {
  State **link;
  u8 *copy = NULL;
  ACQUIRE();
  link = link_to(handle);
  if (link) {
    *size = (*link)->size;
    copy = malloc(*size);
    if (copy) memcpy(copy, (*link)->bytes, *size);
  }
  RELEASE();
  return copy;
}

/* Frees a state, or those of an instance. */
static void free_states(const void *handle, const Instance *owner) {
  State **link, *state;
  ACQUIRE();
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
  RELEASE();
}

static void free_instance(void *handle) {
  Instance *instance = instance_of(handle);
  if (!instance) return;
  free_states(NULL, instance);
  free_memory(instance);
}
