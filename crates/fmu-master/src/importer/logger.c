/* The fmi2CallbackLogger: its message is a format with arguments as printf's. It formats and passes on. */

#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>

/* What the component environment points to; `Receiver` in c_boundary/logger.rs. */
struct receiver {
    void (*receive)(const struct receiver *self, int status, const char *text);
};

void fmu_master_log(void *environment, const char *instance, int status, const char *category,
                   const char *format, ...)
{
    const struct receiver *receiver = environment;
    (void)instance, (void)category;
    if (receiver == NULL || format == NULL)
        return;

    va_list arguments;
    va_start(arguments, format);
    int length = vsnprintf(NULL, 0, format, arguments);
    va_end(arguments);

    char *text = length < 0 ? NULL : malloc((size_t)length + 1);
    if (text == NULL) {
        receiver->receive(receiver, status, format);
        return;
    }
    va_start(arguments, format);
    vsnprintf(text, (size_t)length + 1, format, arguments);
    va_end(arguments);
    receiver->receive(receiver, status, text);
    free(text);
}
