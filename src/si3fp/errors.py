"""The exceptions of si3fp: a message says what failed, where, the value got, and what to do."""


class Si3fpError(Exception):
    """Root of all errors that a user can mend; the command line prints its message and exits 1."""


class InputError(Si3fpError, ValueError):
    """A file or value that the user gave cannot be used."""


class SourceError(Si3fpError, OSError):
    """A file, disk or service could not be read or written."""


class ReconstructionError(Si3fpError):
    """Poses, planes or scale could not be found from the images."""


class FacadeError(Si3fpError):
    """One facade failed; the pipeline turns it into a `Missing` row and goes on."""


class ThermalModelError(Si3fpError, ValueError):
    """The building cannot be written as a valid thermal model."""


class SimulationError(Si3fpError):
    """EnergyPlus failed; the message carries the fatal lines of eplusout.err."""


class MissingDependencyError(Si3fpError, ImportError):
    """An optional package is not installed; the message names the extra that brings it."""
