/* An FMU of FMI 3.0 for co-simulation: y = GAIN * u + bias. It is compiled as its build description says, or not at all. */

#define FMI3_FUNCTION_PREFIX gain_
#include "fmi3Functions.h"

#include <stdlib.h>

#include "bias.h"

#if !defined(GAIN) || !defined(FLAG) || !defined(OPTION) || defined(OPTIONAL) || __STDC_VERSION__ != 201112L
#error "not compiled as described"
#endif

typedef struct {
    double values[2];
} model;

fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean events,
    fmi3Boolean early, const fmi3ValueReference required[], size_t count, fmi3InstanceEnvironment environment,
    fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update)
{
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)events;
    (void)early, (void)required, (void)count, (void)environment, (void)log, (void)update;
    return calloc(1, sizeof(model));
}

void fmi3FreeInstance(fmi3Instance instance)
{
    free(instance);
}

fmi3Status fmi3EnterInitializationMode(
    fmi3Instance instance, fmi3Boolean has_tolerance, fmi3Float64 tolerance, fmi3Float64 start, fmi3Boolean has_stop,
    fmi3Float64 stop)
{
    (void)instance, (void)has_tolerance, (void)tolerance, (void)start, (void)has_stop, (void)stop;
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance)
{
    (void)instance;
    return fmi3OK;
}

fmi3Status fmi3Terminate(fmi3Instance instance)
{
    (void)instance;
    return fmi3OK;
}

fmi3Status fmi3DoStep(
    fmi3Instance instance, fmi3Float64 time, fmi3Float64 size, fmi3Boolean no_restore, fmi3Boolean *event,
    fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *reached)
{
    model *self = instance;
    (void)no_restore;
    *event = *terminate = *early = fmi3False;
    *reached = time + size;
    self->values[1] = GAIN * self->values[0] + bias();
    return fmi3OK;
}

fmi3Status fmi3GetFloat64(
    fmi3Instance instance, const fmi3ValueReference references[], size_t count, fmi3Float64 values[], size_t size)
{
    (void)size;
    for (size_t i = 0; i < count; i++)
        values[i] = ((model *)instance)->values[references[i]];
    return fmi3OK;
}

fmi3Status fmi3SetFloat64(
    fmi3Instance instance, const fmi3ValueReference references[], size_t count, const fmi3Float64 values[], size_t size)
{
    (void)size;
    for (size_t i = 0; i < count; i++)
        ((model *)instance)->values[references[i]] = values[i];
    return fmi3OK;
}

#define UNUSED(type)                                                                                                   \
    fmi3Status fmi3Get##type(                                                                                          \
        fmi3Instance instance, const fmi3ValueReference references[], size_t count, fmi3##type values[], size_t size)  \
    {                                                                                                                  \
        (void)instance, (void)references, (void)count, (void)values, (void)size;                                       \
        return fmi3Error;                                                                                              \
    }                                                                                                                  \
    fmi3Status fmi3Set##type(                                                                                          \
        fmi3Instance instance, const fmi3ValueReference references[], size_t count, const fmi3##type values[],         \
        size_t size)                                                                                                   \
    {                                                                                                                  \
        (void)instance, (void)references, (void)count, (void)values, (void)size;                                       \
        return fmi3Error;                                                                                              \
    }

UNUSED(Float32)
UNUSED(Int8)
UNUSED(UInt8)
UNUSED(Int16)
UNUSED(UInt16)
UNUSED(Int32)
UNUSED(UInt32)
UNUSED(Int64)
UNUSED(UInt64)
UNUSED(Boolean)
UNUSED(String)
