/// Linked first: all code behind it starts at a multiple of a megabyte, whatever startup code the program has before it.
asm(".text\n.p2align 20");
