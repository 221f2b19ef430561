/* WebAssembly's operations for the translated files, under wasm2c's names. Each memory access is checked; a trap ends the
   call. Instances share nothing here. */

#ifndef WASM_H
#define WASM_H

#include <float.h>
#include <math.h>
#include <setjmp.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

/* The same numbers on every platform: products and sums are never contracted, whatever the flags, and doubles are
   doubles. */
#if defined(__FAST_MATH__)
#error "compile without -ffast-math, which changes results"
#endif
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(__GNUC__)
#pragma GCC optimize("fp-contract=off")
#elif defined(_MSC_VER)
#pragma fp_contract(off)
#endif
/* gcc reports 16 if 16-bit numbers are computed as such, and others in their own type. */
#if defined(FLT_EVAL_METHOD) && FLT_EVAL_METHOD != 0 && FLT_EVAL_METHOD != 16 || defined(__TINYC__) && defined(__i386__)
#error "compile with -msse2 -mfpmath=sse, or another compiler: the x87 unit computes with more digits than a double has"
#endif

typedef uint8_t u8;
typedef int8_t s8;
typedef uint16_t u16;
typedef int16_t s16;
typedef uint32_t u32;
typedef int32_t s32;
typedef uint64_t u64;
typedef int64_t s64;
typedef float f32;
typedef double f64;

typedef enum {
  TRAP_NONE,
  TRAP_OOB,
  TRAP_INT_OVERFLOW,
  TRAP_DIV_BY_ZERO,
  TRAP_INVALID_CONVERSION,
  TRAP_UNREACHABLE,
  TRAP_CALL_INDIRECT,
  TRAP_EXHAUSTION,
  TRAP_CALLBACK
} Trap;

/* An instance's memory, little-endian on every machine. It grows within an array of a size known to the compiler, which
   then compares addresses with constants, and need not repeat comparisons or read the memory's address. */
#define PAGE 65536u
typedef struct {
  u32 size, pages;
  /* Pending function calls. */
  u32 depth;
  /* Whether it failed to grow. */
  int is_exhausted;
  /* Where a trap goes. */
  jmp_buf *unwind;
  u8 data[MODEL_PAGES * PAGE];
} wasm_rt_memory_t;

typedef void (*wasm_rt_function_ptr_t)(void);

typedef struct {
  u32 func_type;
  wasm_rt_function_ptr_t func;
  void *module_instance;
} wasm_rt_funcref_t;

typedef struct {
  wasm_rt_funcref_t *data;
  u32 max_size, size;
} wasm_rt_funcref_table_t;

typedef struct {
  u32 func_type_index;
  wasm_rt_function_ptr_t func;
  int is_imported;
} wasm_elem_segment_expr_t;

#if defined(__GNUC__)
#define NORETURN __attribute__((noreturn, cold))
/* Compilers do not inline these in large functions, which are then slow. */
#define INLINE static inline __attribute__((always_inline))
#define UNLIKELY(x) __builtin_expect(!!(x), 0)
#elif defined(_MSC_VER)
#define NORETURN __declspec(noreturn)
#define INLINE static __forceinline
#define UNLIKELY(x) (x)
#else
#define NORETURN
#define INLINE static inline
#define UNLIKELY(x) (x)
#endif
#define LIKELY(x) (!UNLIKELY(!(x)))

#define wasm_rt_allocate_memory PREFIXED(wasm_allocate_memory)
#define wasm_rt_grow_memory PREFIXED(wasm_grow_memory)
#define wasm_rt_free_memory PREFIXED(wasm_free_memory)
#define wasm_rt_allocate_funcref_table PREFIXED(wasm_allocate_table)
#define wasm_rt_free_funcref_table PREFIXED(wasm_free_table)
#define wasm_trap PREFIXED(wasm_trap)

/* The library exports only the FMI functions. */
#if defined(__GNUC__) && !defined(_WIN32)
#define HIDES
#pragma GCC visibility push(hidden)
#endif
void wasm_rt_allocate_memory(wasm_rt_memory_t *memory, u32 pages, u32 max_pages);
u32 wasm_rt_grow_memory(wasm_rt_memory_t *memory, u32 pages);
void wasm_rt_free_memory(wasm_rt_memory_t *memory);
void wasm_rt_allocate_funcref_table(wasm_rt_funcref_table_t *table, u32 size, u32 max_size);
void wasm_rt_free_funcref_table(wasm_rt_funcref_table_t *table);
NORETURN void wasm_trap(wasm_rt_memory_t *memory, Trap trap);
#if defined(HIDES)
#pragma GCC visibility pop
#endif

/* The deepest nesting of calls: far more than models need, and less than stacks allow. */
#define MAX_DEPTH 500

#define TRAP(reason) (wasm_trap(&instance->w2c_memory, TRAP_##reason), 0)
#define UNREACHABLE wasm_trap(&instance->w2c_memory, TRAP_UNREACHABLE)
#define FUNC_PROLOGUE \
  if (UNLIKELY(++instance->w2c_memory.depth > MAX_DEPTH)) wasm_trap(&instance->w2c_memory, TRAP_EXHAUSTION)
#define FUNC_EPILOGUE --instance->w2c_memory.depth

#define CALL_INDIRECT(table, type, signature, x, ...)                                            \
  ((void)(LIKELY((x) < table.size && table.data[x].func && table.data[x].func_type == signature) \
              ? 0                                                                                \
              : TRAP(CALL_INDIRECT)),                                                            \
   ((type)table.data[x].func)(__VA_ARGS__))

INLINE void check_range(wasm_rt_memory_t *memory, u64 address, u64 size) {
  if (UNLIKELY(address + size > sizeof memory->data)) wasm_trap(memory, TRAP_OOB);
}

/* Bytes to numbers and back: one instruction each if the machine has the memory's byte order. */
#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__
static inline void copy_number(void *to, const void *from, size_t size) {
  size_t i;
  for (i = 0; i < size; i++) ((u8 *)to)[i] = ((const u8 *)from)[size - 1 - i];
}
#else
#define copy_number memcpy
#endif

#define DEFINE_LOAD(name, stored, between, result)                  \
  INLINE result name(wasm_rt_memory_t *memory, u64 address) { \
    stored value;                                                   \
    check_range(memory, address, sizeof value);                     \
    copy_number(&value, memory->data + address, sizeof value);      \
    return (result)(between)value;                                  \
  }
#define DEFINE_STORE(name, stored, argument)                                      \
  INLINE void name(wasm_rt_memory_t *memory, u64 address, argument value) { \
    const stored bytes = (stored)value;                                           \
    check_range(memory, address, sizeof bytes);                                   \
    copy_number(memory->data + address, &bytes, sizeof bytes);                    \
  }

DEFINE_LOAD(i32_load, u32, u32, u32)
DEFINE_LOAD(i64_load, u64, u64, u64)
DEFINE_LOAD(f32_load, f32, f32, f32)
DEFINE_LOAD(f64_load, f64, f64, f64)
DEFINE_LOAD(i32_load8_s, s8, s32, u32)
DEFINE_LOAD(i64_load8_s, s8, s64, u64)
DEFINE_LOAD(i32_load8_u, u8, u32, u32)
DEFINE_LOAD(i64_load8_u, u8, u64, u64)
DEFINE_LOAD(i32_load16_s, s16, s32, u32)
DEFINE_LOAD(i64_load16_s, s16, s64, u64)
DEFINE_LOAD(i32_load16_u, u16, u32, u32)
DEFINE_LOAD(i64_load16_u, u16, u64, u64)
DEFINE_LOAD(i64_load32_s, s32, s64, u64)
DEFINE_LOAD(i64_load32_u, u32, u64, u64)
DEFINE_STORE(i32_store, u32, u32)
DEFINE_STORE(i64_store, u64, u64)
DEFINE_STORE(f32_store, f32, f32)
DEFINE_STORE(f64_store, f64, f64)
DEFINE_STORE(i32_store8, u8, u32)
DEFINE_STORE(i32_store16, u16, u32)
DEFINE_STORE(i64_store8, u8, u64)
DEFINE_STORE(i64_store16, u16, u64)
DEFINE_STORE(i64_store32, u32, u64)

static inline void memory_fill(wasm_rt_memory_t *memory, u32 address, u32 value, u32 size) {
  check_range(memory, address, size);
  memset(memory->data + address, (int)(value & 0xff), size);
}

static inline void memory_copy(wasm_rt_memory_t *to, wasm_rt_memory_t *from, u32 to_address, u32 from_address,
                               u32 size) {
  check_range(to, to_address, size);
  check_range(from, from_address, size);
  memmove(to->data + to_address, from->data + from_address, size);
}

#define LOAD_DATA(memory, address, bytes, size) \
  (check_range(&(memory), address, size), (void)memcpy((memory).data + (address), bytes, size))

static inline void funcref_table_init(wasm_rt_funcref_table_t *table, const wasm_elem_segment_expr_t *functions,
                                      u32 count, u32 to, u32 from, u32 size, void *instance) {
  u32 i;
  (void)count;
  for (i = 0; i < size && table->data; i++) {
    const wasm_elem_segment_expr_t *function = &functions[from + i];
    wasm_rt_funcref_t *entry = &table->data[to + i];
    entry->func_type = function->func_type_index;
    entry->func = function->func;
    /* The host of imported functions is an instance's first field. */
    entry->module_instance = function->is_imported ? *(void **)instance : instance;
  }
}

#define DEFINE_COUNTS(bits, type, leading, trailing, ones)              \
  static inline u32 leading(type x) {                                   \
    u32 count = 0;                                                      \
    while (count < bits && !(x >> (bits - 1 - count) & 1)) count++;     \
    return count;                                                       \
  }                                                                     \
  static inline u32 trailing(type x) {                                  \
    u32 count = 0;                                                      \
    while (count < bits && !(x >> count & 1)) count++;                  \
    return count;                                                       \
  }                                                                     \
  static inline u32 ones(type x) {                                      \
    u32 count = 0;                                                      \
    for (; x; x &= x - 1) count++;                                      \
    return count;                                                       \
  }
DEFINE_COUNTS(32, u32, I32_CLZ, I32_CTZ, I32_POPCNT)
DEFINE_COUNTS(64, u64, I64_CLZ, I64_CTZ, I64_POPCNT)

#define DIV_S(result, type, min, x, y)         \
  (UNLIKELY((y) == 0) ? (result)TRAP(DIV_BY_ZERO) \
   : UNLIKELY((type)(x) == min && (type)(y) == -1) ? (result)TRAP(INT_OVERFLOW) \
   : (result)((type)(x) / (type)(y)))
#define REM_S(result, type, min, x, y)         \
  (UNLIKELY((y) == 0) ? (result)TRAP(DIV_BY_ZERO) \
   : UNLIKELY((type)(x) == min && (type)(y) == -1) ? 0 \
   : (result)((type)(x) % (type)(y)))
#define I32_DIV_S(x, y) DIV_S(u32, s32, INT32_MIN, x, y)
#define I64_DIV_S(x, y) DIV_S(u64, s64, INT64_MIN, x, y)
#define I32_REM_S(x, y) REM_S(u32, s32, INT32_MIN, x, y)
#define I64_REM_S(x, y) REM_S(u64, s64, INT64_MIN, x, y)
#define DIV_U(x, y) (UNLIKELY((y) == 0) ? TRAP(DIV_BY_ZERO) : (x) / (y))
#define REM_U(x, y) (UNLIKELY((y) == 0) ? TRAP(DIV_BY_ZERO) : (x) % (y))

#define I32_ROTL(x, y) ((x) << ((y) & 31) | (x) >> ((0u - (y)) & 31))
#define I32_ROTR(x, y) ((x) >> ((y) & 31) | (x) << ((0u - (y)) & 31))
#define I64_ROTL(x, y) ((x) << ((y) & 63) | (x) >> ((0u - (y)) & 63))
#define I64_ROTR(x, y) ((x) >> ((y) & 63) | (x) << ((0u - (y)) & 63))

#define FMIN(x, y) ((x) != (x) || (y) != (y) ? NAN : (x) == 0 && (y) == 0 ? (signbit(x) ? (x) : (y)) : (x) < (y) ? (x) : (y))
#define FMAX(x, y) ((x) != (x) || (y) != (y) ? NAN : (x) == 0 && (y) == 0 ? (signbit(x) ? (y) : (x)) : (x) > (y) ? (x) : (y))

/* Floating point to integer, towards 0: the result exists between `above` and `below`. */
#define TRUNC(result, type, above, below, x)                          \
  (UNLIKELY((x) != (x)) ? (result)TRAP(INVALID_CONVERSION)            \
   : UNLIKELY(!((x) above && (x) < below)) ? (result)TRAP(INT_OVERFLOW) \
                                           : (result)(type)(x))
#define TRUNC_SAT(result, type, above, below, least, greatest, x) \
  ((x) != (x) ? 0 : !((x) above) ? (result)least : !((x) < below) ? (result)greatest : (result)(type)(x))
#define I32_TRUNC_S_F32(x) TRUNC(u32, s32, >= -2147483648.f, 2147483648.f, x)
#define I32_TRUNC_S_F64(x) TRUNC(u32, s32, > -2147483649., 2147483648., x)
#define I32_TRUNC_U_F32(x) TRUNC(u32, u32, > -1.f, 4294967296.f, x)
#define I32_TRUNC_U_F64(x) TRUNC(u32, u32, > -1., 4294967296., x)
#define I64_TRUNC_S_F32(x) TRUNC(u64, s64, >= -9223372036854775808.f, 9223372036854775808.f, x)
#define I64_TRUNC_S_F64(x) TRUNC(u64, s64, >= -9223372036854775808., 9223372036854775808., x)
#define I64_TRUNC_U_F32(x) TRUNC(u64, u64, > -1.f, 18446744073709551616.f, x)
#define I64_TRUNC_U_F64(x) TRUNC(u64, u64, > -1., 18446744073709551616., x)
#define I32_TRUNC_SAT_S_F32(x) TRUNC_SAT(u32, s32, >= -2147483648.f, 2147483648.f, INT32_MIN, INT32_MAX, x)
#define I32_TRUNC_SAT_S_F64(x) TRUNC_SAT(u32, s32, > -2147483649., 2147483648., INT32_MIN, INT32_MAX, x)
#define I32_TRUNC_SAT_U_F32(x) TRUNC_SAT(u32, u32, > -1.f, 4294967296.f, 0, UINT32_MAX, x)
#define I32_TRUNC_SAT_U_F64(x) TRUNC_SAT(u32, u32, > -1., 4294967296., 0, UINT32_MAX, x)
#define I64_TRUNC_SAT_S_F32(x) \
  TRUNC_SAT(u64, s64, >= -9223372036854775808.f, 9223372036854775808.f, INT64_MIN, INT64_MAX, x)
#define I64_TRUNC_SAT_S_F64(x) \
  TRUNC_SAT(u64, s64, >= -9223372036854775808., 9223372036854775808., INT64_MIN, INT64_MAX, x)
#define I64_TRUNC_SAT_U_F32(x) TRUNC_SAT(u64, u64, > -1.f, 18446744073709551616.f, 0, UINT64_MAX, x)
#define I64_TRUNC_SAT_U_F64(x) TRUNC_SAT(u64, u64, > -1., 18446744073709551616., 0, UINT64_MAX, x)

#define DEFINE_REINTERPRET(name, from, to) \
  INLINE to name(from x) {                 \
    to result;                             \
    memcpy(&result, &x, sizeof result);    \
    return result;                         \
  }
DEFINE_REINTERPRET(f32_reinterpret_i32, u32, f32)
DEFINE_REINTERPRET(i32_reinterpret_f32, f32, u32)
DEFINE_REINTERPRET(f64_reinterpret_i64, u64, f64)
DEFINE_REINTERPRET(i64_reinterpret_f64, f64, u64)

/* Exact on every platform (IEEE 754). */
#define wasm_quiet(x) (x)
#define wasm_quietf(x) (x)
#define wasm_floor floor
#define wasm_floorf floorf
#define wasm_ceil ceil
#define wasm_ceilf ceilf
#define wasm_trunc trunc
#define wasm_truncf truncf
#define wasm_nearbyint nearbyint
#define wasm_nearbyintf nearbyintf
#define wasm_fabs fabs
#define wasm_fabsf fabsf
#define wasm_sqrt sqrt
#define wasm_sqrtf sqrtf

#endif
