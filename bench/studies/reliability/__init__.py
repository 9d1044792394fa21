"""Attacks on granpinn as commands: damaged files, full disks, kills. See note.md."""
