/* Writes the path of every file that a process opens to the descriptor GRANPINN_OPENS, one a line.
 *
 * Preloaded before a program. Python reports what it opens itself; this also sees the libraries.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static void report(const char *path) {
  const char *number = getenv("GRANPINN_OPENS");
  char line[4200];
  if (number == NULL || path == NULL) return;
  int n = snprintf(line, sizeof line, "%s\n", path);
  if (n > 0 && n < (int)sizeof line && write(atoi(number), line, (size_t)n) < 0) return;
}

static mode_t mode_of(int flags, va_list arguments) {
  return (flags & (O_CREAT | O_TMPFILE)) ? (mode_t)va_arg(arguments, int) : 0;
}

#define OPEN(name)                                                                       \
  int name(const char *path, int flags, ...) {                                           \
    static int (*real)(const char *, int, ...);                                          \
    va_list arguments;                                                                   \
    va_start(arguments, flags);                                                          \
    mode_t mode = mode_of(flags, arguments);                                             \
    va_end(arguments);                                                                   \
    if (real == NULL) real = (int (*)(const char *, int, ...))dlsym(RTLD_NEXT, #name);   \
    report(path);                                                                        \
    return real(path, flags, mode);                                                      \
  }

OPEN(open)
OPEN(open64)

#define FOPEN(name)                                                                         \
  FILE *name(const char *path, const char *mode) {                                          \
    static FILE *(*real)(const char *, const char *);                                       \
    if (real == NULL) real = (FILE * (*)(const char *, const char *)) dlsym(RTLD_NEXT, #name); \
    report(path);                                                                           \
    return real(path, mode);                                                                \
  }

FOPEN(fopen)
FOPEN(fopen64)
