/* The memory and the table of a module, which grow and trap. */

#include <stdlib.h>

#include "model.h"

void wasm_rt_allocate_memory(wasm_rt_memory_t *memory, u32 pages, u32 max_pages) {
  (void)max_pages;
  memory->pages = memory->size = 0;
  if (wasm_rt_grow_memory(memory, pages) == UINT32_MAX) wasm_trap(memory, TRAP_UNREACHABLE);
}

u32 wasm_rt_grow_memory(wasm_rt_memory_t *memory, u32 pages) {
  const u32 before = memory->pages;
  if (pages > MODEL_PAGES - before) {
    memory->is_exhausted = 1;
    return UINT32_MAX;
  }
  memset(memory->data + memory->size, 0, (size_t)pages * PAGE);
  memory->pages += pages;
  memory->size = memory->pages * PAGE;
  return before;
}

void wasm_rt_free_memory(wasm_rt_memory_t *memory) {
  memory->pages = memory->size = 0;
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
