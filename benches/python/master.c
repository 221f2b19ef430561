/* A native master for FMUs that Python has loaded: the cost of their functions without Python's call overhead. */
#include <stddef.h>
#include <time.h>

typedef int SetReal(void *, const unsigned *, size_t, const double *);
typedef int DoStep(void *, double, double, int);
typedef int GetReal(void *, const unsigned *, size_t, double *);

static double now(void)
{
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

/* The duration (s) of some steps of a size (s) from a time (s) on. Before each, a row of inputs is set, if there
* are any, and after it a row of outputs is read. Negative when a call does not return fmi2OK. */
double run(SetReal *set_real, DoStep *do_step, GetReal *get_real, void *component, double time, double size,
           size_t steps, const unsigned *inputs, size_t input_count, const double *input_rows,
           const unsigned *outputs, size_t output_count, double *output_rows)
{
    double begin = now();
    for (size_t i = 0; i < steps; i++) {
        int status = 0;
        if (input_count > 0)
            status |= set_real(component, inputs, input_count, input_rows + i * input_count);
        status |= do_step(component, time + (double)i * size, size, 1);
        if (output_count > 0)
            status |= get_real(component, outputs, output_count, output_rows + i * output_count);
        if (status != 0)
            return -1;
    }
    return now() - begin;
}
