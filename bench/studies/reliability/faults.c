/* Lets the n-th call that changes a file below a folder fail, or all calls once a disk is full.
 *
 * Preloaded before a program, and told by its environment:
 *   GRANPINN_FAULT_FOLDER   only files below it count
 *   GRANPINN_FAULT_AT       the call that fails, from 1; absent or 0: none
 *   GRANPINN_FAULT_ERRNO    the error, such as 28 (ENOSPC)
 *   GRANPINN_FAULT_STAYS    set: all calls after it that need room fail too
 *   GRANPINN_FAULT_BUDGET   bytes until the disk is full for good
 *   GRANPINN_FAULT_LOG      descriptor for one line "call NAME PATH" a call
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <unistd.h>

static long calls;
static long long written;

static long number(const char *name) {
  const char *text = getenv(name);
  return text == NULL ? 0 : atol(text);
}

static int below(const char *path) {
  const char *folder = getenv("GRANPINN_FAULT_FOLDER");
  char here[PATH_MAX];
  if (folder == NULL || path == NULL) return 0;
  if (path[0] != '/') path = getcwd(here, sizeof here);
  size_t n = strlen(folder);
  return path != NULL && strncmp(path, folder, n) == 0 && (path[n] == 0 || path[n] == '/');
}

/* The path of an open file; NULL for pipes, event counters and the like. */
static const char *path_of(int file, char *path) {
  char link[64];
  snprintf(link, sizeof link, "/proc/self/fd/%d", file);
  ssize_t n = readlink(link, path, PATH_MAX - 1);
  path[n < 0 ? 0 : n] = 0;
  return path[0] == '/' ? path : NULL;
}

/* Counts a call; whether it must fail. `bytes` is what it would add to the disk. */
static int fails(const char *name, const char *path, int needs_room, size_t bytes) {
  if (!below(path)) return 0;
  calls++;
  long log = number("GRANPINN_FAULT_LOG"), at = number("GRANPINN_FAULT_AT");
  if (log > 0) {
    char line[PATH_MAX + 64];
    int n = snprintf(line, sizeof line, "call %s %s\n", name, path);
    static ssize_t (*real)(int, const void *, size_t);
    if (real == NULL) real = (ssize_t(*)(int, const void *, size_t))dlsym(RTLD_NEXT, "write");
    if (n > 0 && n < (int)sizeof line && real((int)log, line, (size_t)n) < 0) return 0;
  }
  int fail = at > 0 && (calls == at || (calls > at && needs_room && getenv("GRANPINN_FAULT_STAYS")));
  const char *budget = getenv("GRANPINN_FAULT_BUDGET");
  if (needs_room && budget != NULL) {
    written += (long long)bytes;
    fail |= written > atoll(budget);
  }
  if (fail) errno = number("GRANPINN_FAULT_ERRNO") > 0 ? (int)number("GRANPINN_FAULT_ERRNO") : ENOSPC;
  return fail;
}

#define REAL(result, name, ...)                                          \
  static result (*real)(__VA_ARGS__);                                    \
  if (real == NULL) real = (result(*)(__VA_ARGS__))dlsym(RTLD_NEXT, #name)

#define OPEN(name)                                                         \
  int name(const char *path, int flags, ...) {                             \
    REAL(int, name, const char *, int, ...);                               \
    va_list arguments;                                                     \
    va_start(arguments, flags);                                            \
    mode_t mode = (flags & O_CREAT) ? (mode_t)va_arg(arguments, int) : 0;  \
    va_end(arguments);                                                     \
    int writes = (flags & O_ACCMODE) != O_RDONLY;                          \
    if (writes && fails("open", path, (flags & O_CREAT) != 0, 0)) return -1; \
    return real(path, flags, mode);                                        \
  }
OPEN(open)
OPEN(open64)

ssize_t write(int file, const void *data, size_t size) {
  REAL(ssize_t, write, int, const void *, size_t);
  char path[PATH_MAX];
  return file > 2 && fails("write", path_of(file, path), 1, size) ? -1 : real(file, data, size);
}

ssize_t writev(int file, const struct iovec *parts, int count) {
  REAL(ssize_t, writev, int, const struct iovec *, int);
  char path[PATH_MAX];
  size_t size = 0;
  for (int i = 0; i < count; i++) size += parts[i].iov_len;
  return file > 2 && fails("writev", path_of(file, path), 1, size) ? -1 : real(file, parts, count);
}

#define PWRITE(name)                                                                 \
  ssize_t name(int file, const void *data, size_t size, off_t offset) {              \
    REAL(ssize_t, name, int, const void *, size_t, off_t);                           \
    char path[PATH_MAX];                                                             \
    return fails("pwrite", path_of(file, path), 1, size) ? -1 : real(file, data, size, offset); \
  }
PWRITE(pwrite)
PWRITE(pwrite64)

#define FSYNC(name)                                                     \
  int name(int file) {                                                  \
    REAL(int, name, int);                                               \
    char path[PATH_MAX];                                                \
    return fails("fsync", path_of(file, path), 0, 0) ? -1 : real(file); \
  }
FSYNC(fsync)
FSYNC(fdatasync)

#define FTRUNCATE(name)                                                         \
  int name(int file, off_t size) {                                              \
    REAL(int, name, int, off_t);                                                \
    char path[PATH_MAX];                                                        \
    return fails("ftruncate", path_of(file, path), 1, 0) ? -1 : real(file, size); \
  }
FTRUNCATE(ftruncate)
FTRUNCATE(ftruncate64)

#define FALLOCATE(name)                                                       \
  int name(int file, off_t start, off_t size) {                               \
    REAL(int, name, int, off_t, off_t);                                       \
    char path[PATH_MAX];                                                      \
    return fails("fallocate", path_of(file, path), 1, (size_t)size) ? errno : real(file, start, size); \
  }
FALLOCATE(posix_fallocate)
FALLOCATE(posix_fallocate64)

int rename(const char *from, const char *to) {
  REAL(int, rename, const char *, const char *);
  return fails("rename", to, 0, 0) ? -1 : real(from, to);
}

int mkdir(const char *path, mode_t mode) {
  REAL(int, mkdir, const char *, mode_t);
  return fails("mkdir", path, 1, 0) ? -1 : real(path, mode);
}
