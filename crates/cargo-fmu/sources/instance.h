/* An instance, with its own module and memory; its messages; what its module imports.

   The file that includes this has defined `Importer`, and then the two functions that are declared here. */

#include <stdio.h>
#include <stdlib.h>

#include "model.h"

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

/* A 32-bit size; a too large one stays too large. */
static u32 as_size(size_t size) {
  return size > UINT32_MAX ? UINT32_MAX : (u32)size;
}

/* Ends the call for want of memory. */
static void exhaust(wasm_rt_memory_t *memory) {
  memory->is_exhausted = 1;
  wasm_trap(memory, TRAP_UNREACHABLE);
}

/* Memory in the module; freed manually, as a trap frees the module. */
static u32 allocate(Instance *instance, size_t size) {
  const u32 address = Z_modelZ_fmu_allocate(&instance->module, as_size(size));
  if (!address) exhaust(&instance->module.w2c_memory);
  return address;
}

/* The length of a string in the module, which ends in 0. */
static u32 length_at(wasm_rt_memory_t *memory, u32 address) {
  const u8 *end;
  check_range(memory, address, 1);
  end = memchr(memory->data + address, 0, sizeof memory->data - address);
  if (!end) wasm_trap(memory, TRAP_OOB);
  return (u32)(end - (memory->data + address));
}

static char *copy_of(const char *text) {
  char *copy = text ? malloc(strlen(text) + 1) : NULL;
  return copy ? strcpy(copy, text) : NULL;
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
  if (size == UINT32_MAX) size = length_at(memory, address);
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
