"""The tool that compiles: kernels as they are declared, their machine code, and where it is kept."""
