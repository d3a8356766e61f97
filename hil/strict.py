"""What is checked at a door: a table of a file, or of a request."""

from pydantic import BaseModel, ConfigDict


class Strict(BaseModel):
    """A table in which nothing stands that is not known, never changed once it is read."""

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)
