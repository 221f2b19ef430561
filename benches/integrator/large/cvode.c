/* Solves the rod, the cube or the network to 1 s by CVODE: with its banded solver or, for the network, its dense one, which
   approximate the Jacobian by differences. Arguments: system, states, tolerance, number of outputs, file for the states at the end. Prints the
   processor time in s. */

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_band.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_band.h>
#include <sunmatrix/sunmatrix_dense.h>

static const double PI = 3.14159265358979323846;
static sunindextype size;

static int rod(double time, N_Vector states, N_Vector slopes, void *unused) {
    const double *x = N_VGetArrayPointer(states);
    double *slope = N_VGetArrayPointer(slopes);
    double rate = 0.01 * (double)(size * size);
    slope[0] = (x[1] - x[0]) * rate;
    for (sunindextype cell = 1; cell < size - 1; cell++)
        slope[cell] = (x[cell - 1] - x[cell] * 2.0 + x[cell + 1]) * rate;
    slope[size - 1] = (x[size - 2] - x[size - 1]) * rate;
    return 0;
}

static int network(double time, N_Vector states, N_Vector slopes, void *unused) {
    const double *x = N_VGetArrayPointer(states);
    double *slope = N_VGetArrayPointer(slopes);
    uint64_t seed = 1;
    for (sunindextype node = 0; node < size; node++) slope[node] = 0.0;
    for (sunindextype node = 0; node < size; node++) {
        for (int link = 0; link < 2; link++) {
            seed = seed * 6364136223846793005u + 1442695040888963407u;
            sunindextype other = (sunindextype)((seed >> 33) % (uint64_t)size);
            seed = seed * 6364136223846793005u + 1442695040888963407u;
            double share = (double)((seed >> 33) % 1000) / 1000.0;
            double conductance = 0.1 + 100.0 * share * share * share * share;
            double difference = x[node] - x[other];
            double flow = difference * (difference * difference + 1.0) * conductance;
            slope[node] -= flow;
            slope[other] += flow;
        }
    }
    return 0;
}

static int cube(double time, N_Vector states, N_Vector slopes, void *unused) {
    const double *x = N_VGetArrayPointer(states);
    double *slope = N_VGetArrayPointer(slopes);
    sunindextype edge = lround(cbrt((double)size));
    double rate = 0.01 * (double)(edge * edge);
    for (sunindextype cell = 0; cell < size; cell++) {
        double sum = 0.0;
        for (sunindextype stride = 1; stride < size; stride *= edge) {
            sunindextype place = cell / stride % edge;
            if (place > 0) sum += x[cell - stride] - x[cell];
            if (place + 1 < edge) sum += x[cell + stride] - x[cell];
        }
        slope[cell] = sum * rate;
    }
    return 0;
}

static double seconds(void) {
    struct timespec time;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
    return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

int main(int count, char **arguments) {
    if (count != 6) return 2;
    char system = arguments[1][0];
    size = atol(arguments[2]);
    sunindextype edge = lround(cbrt((double)size));
    double tolerance = atof(arguments[3]);
    int outputs = atoi(arguments[4]);
    SUNContext context;
    if (SUNContext_Create(NULL, &context)) return 1;
    N_Vector states = N_VNew_Serial(size, context);
    double *x = N_VGetArrayPointer(states);
    for (sunindextype i = 0; i < size; i++) {
        double angle = PI * ((double)i + 0.5) / (double)size;
        x[i] = system == 'r' ? cos(angle) + 0.5 * cos(10.0 * angle) : system == 'n' ? sin((double)i) : 0.0;
        for (sunindextype stride = 1; system == 'c' && stride < size; stride *= edge)
            x[i] += cos(PI * ((double)(i / stride % edge) + 0.5) / (double)edge);
    }
    CVRhsFn rates = system == 'r' ? rod : system == 'n' ? network : cube;
    sunindextype width = system == 'r' ? 1 : edge * edge;
    double begin = seconds(), time;
    void *memory = CVodeCreate(CV_BDF, context);
    if (CVodeInit(memory, rates, 0.0, states)) return 1;
    if (CVodeSStolerances(memory, tolerance, tolerance)) return 1;
    SUNMatrix matrix = system == 'n' ? SUNDenseMatrix(size, size, context) : SUNBandMatrix(size, width, width, context);
    SUNLinearSolver solver = system == 'n' ? SUNLinSol_Dense(states, matrix, context)
                                           : SUNLinSol_Band(states, matrix, context);
    if (CVodeSetLinearSolver(memory, solver, matrix)) return 1;
    if (CVodeSetMaxNumSteps(memory, 1000000)) return 1;
    for (int output = 1; output <= outputs; output++)
        if (CVode(memory, (double)output / outputs, states, &time, CV_NORMAL) < 0) return 1;
    printf("%.9f\n", seconds() - begin);
    FILE *file = fopen(arguments[5], "wb");
    return file == NULL || fwrite(x, sizeof *x, (size_t)size, file) != (size_t)size || fclose(file) != 0;
}
