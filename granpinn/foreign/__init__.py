"""Files of strangers are opened by libraries in a process of their own.

Libraries crash or hang on some damaged files, and allocate whatever a file declares. Here they do
so alone, with limits of memory and time. The modules of the readers run in that process: each opens
one kind of file and holds the policy for it. `program.py` is the process, `process.py` asks it.
"""

from granpinn.foreign.process import read_foreign, start

__all__ = ["read_foreign", "start"]
