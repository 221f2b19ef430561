/* The functions for saved states, alike in every FMI version. An importer's handle is looked up and never used as an
   address; the module receives the state as bytes. */

/* The module's counterpart of an importer's handle at `cell`: null, a state, or 1 if invalid. */
static u32 load_state(Instance *instance, const void *handle, u32 cell) {
  Z_model_instance_t *module = &instance->module;
  size_t size = 0;
  u8 *bytes = copy_of_state(handle, &size);
  u32 address, state;
  i32_store(&module->w2c_memory, cell, handle ? 1 : 0);
  if (!bytes) return handle ? 1 : 0;
  address = Z_modelZ_fmu_allocate(module, as_size(size));
  if (address) memcpy(module->w2c_memory.data + address, bytes, size);
  free(bytes);
  if (!address) allocate(instance, UINT32_MAX);
  state = Z_modelZ_fmu_load_state(module, instance->handle, address, (u32)size);
  Z_modelZ_fmu_free(module, address, (u32)size);
  if (state) i32_store(&module->w2c_memory, cell, state);
  return i32_load(&module->w2c_memory, cell);
}

/* Frees the module's state at `cell`. */
static void drop_state(Instance *instance, u32 cell) {
  if (i32_load(&instance->module.w2c_memory, cell) > 1) FREE_STATE(&instance->module, instance->handle, cell);
}

/* Importers' pointers may have any alignment. */
static void *handle_at(const void *address) {
  void *handle;
  memcpy(&handle, address, sizeof handle);
  return handle;
}

static void put_handle(void *address, void *handle) {
  memcpy(address, &handle, sizeof handle);
}

/* Keeps a copy of bytes as the state of an importer's handle, which a call returns; returns its status. */
static u32 keep_copy(Instance *instance, const Call *call, void *handle, const void *from, size_t size, u32 status) {
  u8 *bytes = malloc(size ? size : 1);
  if (bytes) memcpy(bytes, from, size);
  if (!bytes || !keep(instance, &handle, bytes, size)) {
    add_error(instance, call->name, "out of memory", "", "");
    return STATUS_ERROR;
  }
  put_handle(call->state, handle);
  return status;
}

static u32 get_state(Instance *instance, Call *call) {
  Z_model_instance_t *module = &instance->module;
  u32 cell, size, address, status;
  size_t known_size;
  u8 *known;
  void *handle;
  if (!call->state) return GET_STATE(module, instance->handle, 0);
  cell = allocate(instance, 8);
  handle = handle_at(call->state);
  known = copy_of_state(handle, &known_size);
  i32_store(&module->w2c_memory, cell, handle && !known ? 1 : 0);
  free(known);
  status = GET_STATE(module, instance->handle, cell);
  if (status <= STATUS_WARNING) {
    const u32 state = i32_load(&module->w2c_memory, cell);
    size = Z_modelZ_fmu_state_size(module, state);
    address = allocate(instance, size);
    Z_modelZ_fmu_save_state(module, state, address);
    drop_state(instance, cell);
    check_range(&module->w2c_memory, address, size);
    status = keep_copy(instance, call, handle, module->w2c_memory.data + address, size, status);
    Z_modelZ_fmu_free(module, address, size);
  }
  Z_modelZ_fmu_free(module, cell, 8);
  return status;
}

static u32 set_state(Instance *instance, Call *call) {
  const u32 cell = allocate(instance, 8);
  const u32 state = load_state(instance, call->handle, cell);
  const u32 status = SET_STATE(&instance->module, instance->handle, state);
  drop_state(instance, cell);
  Z_modelZ_fmu_free(&instance->module, cell, 8);
  return status;
}

static u32 free_state(Instance *instance, Call *call) {
  Z_model_instance_t *module = &instance->module;
  u32 cell, status;
  size_t size;
  u8 *known;
  void *handle;
  if (!call->state) return FREE_STATE(module, instance->handle, 0);
  cell = allocate(instance, 8);
  handle = handle_at(call->state);
  known = copy_of_state(handle, &size);
  i32_store(&module->w2c_memory, cell, handle && !known ? 1 : 0);
  status = FREE_STATE(module, instance->handle, cell);
  if (known && status <= STATUS_WARNING) {
    free_states(handle, NULL);
    put_handle(call->state, NULL);
  }
  free(known);
  Z_modelZ_fmu_free(module, cell, 8);
  return status;
}

static u32 get_state_size(Instance *instance, Call *call) {
  Z_model_instance_t *module = &instance->module;
  const u32 cell = allocate(instance, 8);
  const u32 state = load_state(instance, call->handle, cell);
  const u32 status = STATE_SIZE(module, instance->handle, state, call->bytes ? cell + 4 : 0);
  if (status <= STATUS_WARNING) {
    const size_t size = i32_load(&module->w2c_memory, cell + 4);
    memcpy(call->bytes, &size, sizeof size);
  }
  drop_state(instance, cell);
  Z_modelZ_fmu_free(module, cell, 8);
  return status;
}

static u32 serialize(Instance *instance, Call *call) {
  Z_model_instance_t *module = &instance->module;
  const u32 cell = allocate(instance, 8), size = as_size(call->size);
  const u32 state = load_state(instance, call->handle, cell);
  /* A wrong size is an error before it is used. */
  const u32 address = call->bytes ? Z_modelZ_fmu_allocate(module, size) : 0;
  const u32 status = SERIALIZE(module, instance->handle, state, address, size);
  if (status <= STATUS_WARNING && address) {
    check_range(&module->w2c_memory, address, size);
    memcpy(call->bytes, module->w2c_memory.data + address, size);
  }
  if (address) Z_modelZ_fmu_free(module, address, size);
  drop_state(instance, cell);
  Z_modelZ_fmu_free(module, cell, 8);
  return status;
}

static u32 deserialize(Instance *instance, Call *call) {
  Z_model_instance_t *module = &instance->module;
  const u32 cell = allocate(instance, 8), size = as_size(call->size);
  u32 address = call->bytes && size ? allocate(instance, size) : 0, status;
  if (address) {
    check_range(&module->w2c_memory, address, size);
    memcpy(module->w2c_memory.data + address, call->bytes, size);
  }
  i32_store(&module->w2c_memory, cell, 0);
  status = DESERIALIZE(module, instance->handle, address, size, call->state ? cell : 0);
  if (status <= STATUS_WARNING) {
    status = keep_copy(instance, call, NULL, call->bytes, size, status);
    drop_state(instance, cell);
  }
  if (address) Z_modelZ_fmu_free(module, address, size);
  Z_modelZ_fmu_free(module, cell, 8);
  return status;
}

static int call_of_state(void *handle, const char *name, u32 (*body)(Instance *, Call *), void *handle_of_state,
                         void *state, void *bytes, size_t size) {
  Instance *instance = instance_of(handle);
  Call call = {0};
  if (!instance) return STATUS_ERROR;
  call.name = name;
  call.perform = body;
  call.handle = handle_of_state;
  call.state = state;
  call.bytes = bytes;
  call.size = size;
  return perform(instance, &call);
}

/* A function for saved states: its name and parameters, its body, and what this takes. */
#define STATE_FUNCTION(name, parameters, body, handle, state, bytes, size)                             \
  EXPORT int FMI(name) parameters {                                                                    \
    return call_of_state(instance, #name, body, handle, state, (void *)(uintptr_t)(bytes), size);      \
  }
