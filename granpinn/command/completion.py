"""`granpinn completion SHELL`: a script that completes verbs, flags and their choices.

The words are taken from the help of every verb when the script is printed. Completion itself starts
no Python. Everything else is completed as a file name.
"""

from __future__ import annotations

import contextlib
import io
import re
import shlex
from collections.abc import Callable, Mapping, Sequence

from granpinn.errors import BadInput

FLAG = re.compile(r"^\s+(?:-\w, )?(--[A-Za-z][\w.-]*)(?: \{([^}]*)\})?", re.MULTILINE)

BASH = """# bash completion of granpinn; for every shell: put this line into ~/.bashrc
#   eval "$(granpinn completion bash)"
_granpinn() {{
    local word=${{COMP_WORDS[COMP_CWORD]}} before=${{COMP_WORDS[COMP_CWORD-1]}}
    local words=""
    if [ "$COMP_CWORD" -eq 1 ]; then
        words={verbs}
    else
        case "${{COMP_WORDS[1]}} $before" in
{choices}
        *)
            case "$word ${{COMP_WORDS[1]}}" in
{flags}
            esac ;;
        esac
    fi
    COMPREPLY=($(compgen -W "$words" -- "$word"))
}}
complete -o default -F _granpinn granpinn
"""
ZSH = """# zsh completion of granpinn; for every shell: put this line into ~/.zshrc
#   eval "$(granpinn completion zsh)"
autoload -Uz compinit bashcompinit
(( $+functions[compdef] )) || compinit
bashcompinit
"""
FISH = """# fish completion of granpinn: put this line into ~/.config/fish/config.fish
#   granpinn completion fish | source
"""
SHELLS = ("bash", "zsh", "fish")

Command = Callable[[Sequence[str]], int]


def main(argv: Sequence[str], commands: Mapping[str, Command]) -> int:
    """Print the script; returns the exit code 0.

    Args:
        argv: the shell.
        commands: verb -> its command, which prints its flags for --help.

    Raises:
        BadInput: there is no script for the shell.
    """
    if any(word in ("-h", "--help") for word in argv):
        print(f"usage: granpinn completion {{{','.join(SHELLS)}}}\n\n{__doc__.strip()}\n")
        print('put eval "$(granpinn completion bash)" into ~/.bashrc, or the same for zsh')
        return 0
    if len(argv) != 1 or argv[0] not in SHELLS:
        got = " ".join(argv) or "nothing"
        raise BadInput(
            f"the shell must be one of {', '.join(SHELLS)}, got {got}: granpinn completion bash"
        )
    print(script(argv[0], {verb: flags_of(command) for verb, command in commands.items()}))
    return 0


def flags_of(command: Command) -> dict[str, list[str]]:
    """Flag -> its choices (mostly none), as the help of a command lists them."""
    text = _printed(command, "--help")
    if "--help-all" in text:
        text = _printed(command, "--help-all")
    found = dict(FLAG.findall(text))
    return {flag: choices.split(",") if choices else [] for flag, choices in found.items()}


def _printed(command: Command, flag: str) -> str:
    text = io.StringIO()
    with contextlib.redirect_stdout(text), contextlib.suppress(SystemExit):
        command([flag])
    return text.getvalue()


def script(shell: str, verbs: Mapping[str, Mapping[str, Sequence[str]]]) -> str:
    """The completion script of a shell for verb -> flag -> choices."""
    if shell == "fish":
        return _fish(verbs)
    flags = [f"            --*' {verb}') words={_words(found)} ;;" for verb, found in verbs.items()]
    flags.append(f"            *' completion') words={_words(SHELLS)} ;;")
    choices = [
        f"        {shlex.quote(f'{verb} {flag}')}) words={_words(values)} ;;"
        for verb, found in verbs.items()
        for flag, values in found.items()
        if values
    ]
    body = BASH.format(
        verbs=_words([*verbs, "completion"]), choices="\n".join(choices), flags="\n".join(flags)
    )
    if shell == "bash":
        return body.rstrip("\n")
    return ZSH + body[body.index("_granpinn()") :].rstrip("\n")


def _fish(verbs: Mapping[str, Mapping[str, Sequence[str]]]) -> str:
    """One `complete` for the verbs, and one for every flag: the second word says which apply."""
    first = "complete -c granpinn -n"
    lines = [f"{first} __fish_use_subcommand -f -a {_words([*verbs, 'completion'])}"]
    lines += [
        f"{first} {_after(verb)} -l {flag[2:]}" + (f" -x -a {_words(values)}" if values else "")
        for verb, found in verbs.items()
        for flag, values in found.items()
    ]
    lines.append(f"{first} {_after('completion')} -f -a {_words(SHELLS)}")
    return FISH + "\n".join(lines)


def _after(verb: str) -> str:
    """The condition that a line is about a verb; a file may have the name of another one."""
    return shlex.quote(f"contains -- {verb} (commandline -opc)[2]")


def _words(words: Sequence[str] | Mapping[str, Sequence[str]]) -> str:
    return shlex.quote(" ".join(words))
