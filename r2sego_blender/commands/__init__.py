"""The commands of ``r2sego``, by what they are about; ``cli`` puts them in one tree."""
