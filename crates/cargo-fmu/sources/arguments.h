/* The arguments of calls, which are copied into the module's memory, and the results, which are copied out of it. */

#include "instance.h"

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
  *allocated = allocate(instance, (size_t)(size > UINT32_MAX ? UINT32_MAX : size));
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
  const u32 size = sizes ? i32_load(memory, sizes + 4 * (u64)index) : length_at(memory, address) + 1;
  check_range(memory, address, size);
  return size;
}

/* Copies the module's strings or binaries, from an array of addresses, to the instance's memory. */
static void take_strings(Instance *instance, u32 addresses, u32 sizes, void *texts, size_t count) {
  wasm_rt_memory_t *memory = &instance->module.w2c_memory;
  size_t size = 1, i;
  char *end;
  for (i = 0; i < count; i++) size += size_at(memory, i32_load(memory, addresses + 4 * (u64)i), sizes, i);
  free(instance->strings);
  instance->strings = end = malloc(size);
  if (!end) exhaust(memory);
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
