/* The fmi2CallbackLogger: its message is a format with arguments as printf's. It formats and passes on. */

#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

/* In c_boundary/logger.rs. The environment is a number to it. */
typedef void receiver(uintptr_t environment, const char *instance, int status, const char *text);
typedef void logger(uintptr_t environment, const char *instance, int status, const char *category, const char *format, ...);

static receiver *receive;

static void log_message(uintptr_t environment, const char *instance, int status, const char *category, const char *format,
                        ...)
{
    (void)category;
    char *text = NULL;
    if (format != NULL) {
        va_list arguments;
        va_start(arguments, format);
        int length = vsnprintf(NULL, 0, format, arguments);
        va_end(arguments);

        text = length < 0 ? NULL : malloc((size_t)length + 1);
        if (text != NULL) {
            va_start(arguments, format);
            vsnprintf(text, (size_t)length + 1, format, arguments);
            va_end(arguments);
        }
    }
    receive(environment, instance, status, text == NULL ? format : text);
    free(text);
}

/* Makes the logger pass messages on. */
logger *fmu_master_logger(receiver *to)
{
    receive = to;
    return log_message;
}
